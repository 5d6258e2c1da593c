"""Short simulated cases for the tests of estimation and diagnosis, made once."""

import dataclasses
import re
import signal
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from browser import BROWSER

from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.identification import identify as identification
from drift_drake.gap.identification.calibration import Identification
from drift_drake.gap.identification.stated import Asked
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth
from experiments.other_worlds.days import Days, first_guess, make_day
from experiments.other_worlds.drivers import DAY_ONE

TRUE_STIFFNESS = -0.25
DURATION = 3.0
# What takes long to make, and the fixtures that are made of it. The tests of a module that names one of these are one
# worker's, all of them; the modules of the last group take longest, and come first.
LONG_TO_MAKE = {
    "stiffness_case": (),
    "good_cases": (),
    "identified": (),
    "other_car": ("diagnosed", "searched", "late_day", "plain_day", "strange_day"),
}
OTHER_CAR = Days(Path(), car="coupe", seed=7, duration=5.0)


def pytest_configure():
    """Ctrl-C is heard by the tests and by what they start, in the background of a shell too, which ignores it there."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@cache
def group(module: Path) -> str:
    """What the module's tests share with other modules' tests, or the module itself."""
    words, shared = set(re.findall(r"\w+", module.read_text(encoding="utf-8"))), str(module)
    for name, made_of_it in LONG_TO_MAKE.items():
        shared = name if words & {name, *made_of_it} else shared
    return shared


def pytest_collection_modifyitems(items):
    """The longest groups first, so that no worker is left with one at the end."""
    order = [*LONG_TO_MAKE][::-1]
    for item in items:
        if set(order) & set(item.fixturenames) and group(item.path) not in order:
            raise pytest.UsageError(f"{item.path}: name in LONG_TO_MAKE the fixture that it has through another one")
    items.sort(key=lambda item: order.index(group(item.path)) if group(item.path) in order else len(order))


@pytest.hookimpl(optionalhook=True)  # without pytest-xdist nobody calls it
def pytest_xdist_make_scheduler(config, log):
    """One worker has all tests of a module, and of the modules that share what takes long to make.

    Marks (`xdist_group`) are not enough: pytest 9.2 ignores the names that pytest-xdist 3.8 gives the tests for them.
    """
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class ByGroup(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group(config.rootpath / nodeid.partition("::")[0])

    return ByGroup(config, log)


@dataclasses.dataclass(frozen=True)
class OtherCar:
    """A car that no single-track model follows, calibrated on a short day."""

    runs: list[Run]  # of the day of calibration
    guess: VehicleParameters
    found: Identification

    @property
    def normal(self) -> Normal:
        assert self.found.calibration.normal is not None
        return self.found.calibration.normal

    def day(self, effects: dict[str, float], index: int, duration: float = OTHER_CAR.duration) -> list[Run]:
        """Runs of a later day of the same car with effects, each of `duration` [s]."""
        return make_day(dataclasses.replace(OTHER_CAR, duration=duration), effects, DAY_ONE, index)


@pytest.fixture(scope="session")
def other_car():
    """Some parameters known, some effects left out, no fit by likelihood tried: which is quick."""
    runs, guess = make_day(OTHER_CAR, {}, DAY_ONE, 0), first_guess(OTHER_CAR.car)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(identification, "FURTHER", ())
        asked = Asked(
            guess, case="short", names=("tyre_relaxation", "longitudinal_load_transfer"),
            known=("mass", "front_axle_distance", "rear_axle_inertia", "steering_offset"),
            tolerances=frozenset({"yaw_inertia", "torque"}), criterion="prediction", kind="single-track",
        )  # fmt: skip
        found = identification.calibrate(runs, asked)
    return OtherCar(runs, guess, found)


@pytest.fixture(scope="session")
def stiffness_case():
    """Three seconds of each manoeuvre by a car with softer rear tyres and a torque map that is off."""
    truth = Truth({"rear_stiffness_error": TRUE_STIFFNESS}, {}, {"torque": 0.02, "mass": -0.01})
    return truth, make_case(truth, VehicleParameters(), np.random.default_rng(11), DURATION)


@pytest.fixture
def undrawn(monkeypatch):
    """Pictures' files are there, and empty: drawing takes long, and other tests look at what is drawn."""
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda _, path, **__: Path(path).touch())


@pytest.fixture(scope="session")
def model():
    """The shipped model."""
    return load_model()


@pytest.fixture(scope="module")  # while it is open, a test of its module cannot run an event loop of its own
def browser():
    """Chromium, driven by playwright."""
    playwright = pytest.importorskip("playwright.sync_api", reason="a real browser is driven by playwright")
    if BROWSER is None:
        pytest.skip("no Chromium on this machine: apt install chromium")
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", "--enable-unsafe-swiftshader"])
        yield chromium
        chromium.close()
