"""Kinds of car of another package, found by entry points: file, plant, step model and predictions know them."""

from pathlib import Path

import pytest
from other_package import ROOT, install_package, refusal, run

from drift_drake.car.effects.trial import CARS, EFFECTS, TYRES, extensions
from drift_drake.car.installed_cars import installed_cars

EXAMPLE = (ROOT / "examples" / "cars" / "kart.py").read_text()
FLAWED = """
import dataclasses

import numpy as np

from kart import KART, KartParameters, rates

def hot(z, command, car, out):
    rates(z, command, car, out)
    out[1] = np.inf

def still(z, constants, effects):
    return 0.0

def heavier(p, q):
    return p._replace(mass=p.mass + 1.0)

@dataclasses.dataclass(frozen=True)
class Other(KartParameters):
    def to_dict(self):
        return {"cart": {}}

HOT = dataclasses.replace(KART, rates=hot)
STILL = dataclasses.replace(KART, fastest=still)
HEAVIER = dataclasses.replace(KART, changed_constants=heavier)
NAMELESS = dataclasses.replace(KART, parameters=Other)
UNSIZED = dataclasses.replace(KART, own_scale=(0.3,))
BARE = dataclasses.replace(KART, parameters=None)
NUMBER = 3
"""
KNOWN = """
import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from kart import KART, KartParameters
from drift_drake.car.car_file import read_car
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.equations import EQUATIONS, folded_into
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.log.table import Run
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.gap.estimation.windows import errors, windowed

car, q = KartParameters(scrub=30.0), make_effects({"mass_error": 0.1, "steering_lag": 0.05, "aero_drag": 0.5})
write_vehicle("car.yaml", car, q)
assert read_car("car.yaml") == (car, q)
assert EQUATIONS[type(car.constants())].label == "kart"
assert folded_into(car.constants(), q)[0].mass == 1.1 * car.mass

# The plant: a yaw moment that grows with the scrub.
plant = EquationsPlant(car, q)
context = plant.CreateDefaultContext()
plant.set_initial(context, [0.5, 8.0, -0.05, 8.2, 0.0, 0.0], actuation=(0.1, 10.0))
plant.GetInputPort("actuation").FixValue(context, [0.1, 10.0])
slopes = plant.EvalTimeDerivatives(context).CopyToVector()
p = car.constants()
assert plant.state_names[-2:] == ("steering", "torque") and slopes[-2:].tolist() == [0.0, 0.0]
by_ad = plant.ToAutoDiffXd()
assert by_ad.num_continuous_states() == 12
scrubbed = EquationsPlant(car.replace(scrub=31.0), q)
other = scrubbed.CreateDefaultContext()
scrubbed.set_initial(other, [0.5, 8.0, -0.05, 8.2, 0.0, 0.0], actuation=(0.1, 10.0))
scrubbed.GetInputPort("actuation").FixValue(other, [0.1, 10.0])
np.testing.assert_allclose(scrubbed.EvalTimeDerivatives(other).CopyToVector()[0] - slopes[0], -0.5 / p.yaw_inertia)

# Of its own log nothing is left of a window's prediction.
t = np.arange(0.0, 3.0, 0.01)
u = np.stack([0.1 * np.sin(4.0 * t), 8.0 + 4.0 * np.sin(3.0 * t)])
builder = DiagramBuilder()
builder.AddSystem(plant)
source = builder.AddSystem(TrajectorySource(PiecewisePolynomial.FirstOrderHold(t, u)))
builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
log = LogVectorOutput(plant.GetOutputPort("full_state"), builder, 0.01)
diagram = builder.Build()
context = diagram.CreateDefaultContext()
plant.set_initial(plant.GetMyMutableContextFromRoot(context), [0.0, 8.0, 0.0, 8.0, 0.0, 0.0], actuation=tuple(u[:, 0]))
simulator = Simulator(diagram, context)
simulator.get_mutable_integrator().set_target_accuracy(1e-7)
simulator.AdvanceTo(t[-1])
x = log.FindLog(context).data()
r, v, beta, omega_r = x[:4]
run = windowed(Run("run_0", t, r, v, *u, beta, omega_r, psi=x[9]))
assert np.abs(errors([run], p, q)).max() < 5e-3 < np.abs(errors([run], p, Effects())).max()
print("fine")
"""


def test_a_kind_of_another_package_is_read_driven_and_predicted(tmp_path: Path) -> None:
    install_package(tmp_path, "kart", EXAMPLE, "cars", {"kart": "KART"})
    (tmp_path / "known.py").write_text(KNOWN)
    done = run(tmp_path, "known.py", jit=True)
    assert done.stdout == "fine\n", done.stderr[-3000:]


@pytest.mark.parametrize(
    ("name", "attribute", "says"),
    [
        ("brush", "KART", "brush is a key of vehicle files already"),
        ("kart", "NUMBER", "car kart (flawed:NUMBER): is no drift_drake.car.kind.CarKind"),
        ("kart", "MISSING", "car kart (flawed:MISSING): cannot be imported"),
        ("kart", "HOT", "at v = 0 m/s, beta = 0 rad under 0 rad and 0 N m its rates are"),
        ("kart", "STILL", "the fastest 0; let all be finite, and the fastest positive"),
        ("kart", "HEAVIER", "its numbers change without effects"),
        ("kart", "NAMELESS", "to_dict gives no kart"),
        ("kart", "UNSIZED", "own_scale does not give a positive size to each of ('steering', 'torque')"),
        ("kart", "BARE", "has no parameters"),
    ],
)
def test_one_that_cannot_be_used_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, attribute: str, says: str
) -> None:
    (tmp_path / "kart.py").write_text(EXAMPLE)
    install_package(tmp_path, "flawed", FLAWED, "cars", {name: attribute})
    monkeypatch.setenv("DRIFT_DRAKE_TRYING", "1")  # what a trial in a process of its own says is said here
    said = refusal("flawed", tmp_path, installed_cars.__wrapped__)
    assert says in said
    assert "\n" not in said


def test_what_numba_cannot_compile_is_refused_before_it_is_used(tmp_path: Path) -> None:
    source = EXAMPLE.replace("    return p.rear_stiffness", "    assert {}.get(1) is None\n    return p.rear_stiffness")
    assert source != EXAMPLE
    install_package(tmp_path, "kart", source, "cars", {"kart": "KART"})
    done = run(tmp_path, "-c", "import drift_drake.car.equations", jit=True)
    assert "car kart (kart:KART): numba cannot compile its functions" in done.stderr


@pytest.mark.parametrize(("group", "word"), [(EFFECTS, "effect"), (TYRES, "tyre"), (CARS, "car")])
def test_two_extensions_of_one_name_are_refused(tmp_path: Path, group: str, word: str) -> None:
    for name in ("one", "other"):
        install_package(tmp_path, name, "HERE = 1", group.removeprefix("drift_drake."), {"same": "HERE", name: "HERE"})
    said = refusal("one", tmp_path, lambda: extensions(group))
    assert said in (f"{word} same is installed twice ({a}:HERE, {b}:HERE); uninstall one of them"
                    for a, b in (("one", "other"), ("other", "one")))  # fmt: skip
