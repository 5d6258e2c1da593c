"""Windows of double-track cars, eight pairs of a car and a window at once: what each is alone."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants
from drift_drake.car.log.table import Run
from drift_drake.gap.estimation import windows
from drift_drake.gap.estimation.followed import LEAD
from drift_drake.gap.estimation.windows import WindowedRun, errors, run_errors_of, windowed
from tests.gap.estimation.test_double_track_windows import EFFECTS, LIVELY, rolled

OTHER = EFFECTS._replace(friction_level=-0.1, front_stiffness_error=0.2, gyro_bias=0.02, drivetrain_friction=40.0)
CAR = CARS["roadster"].constants()


@pytest.fixture(scope="module")
def run() -> Run:
    return rolled(LIVELY, duration=4.0)


def with_starts(run: WindowedRun, starts: np.ndarray) -> WindowedRun:
    return dataclasses.replace(run, starts=np.ascontiguousarray(starts))


def one_by_one(run: WindowedRun, constants: CarConstants, effects: Effects) -> np.ndarray:
    """The same errors, each window predicted alone."""
    found = [errors([with_starts(run, run.starts[i : i + 1])], constants, effects) for i in range(len(run.starts))]
    return np.concatenate([*found, np.empty((0, windows.HORIZONS, 5))])


@pytest.mark.parametrize("without", [(), ("tau_cmd",), ("omega_r",)])
def test_eight_at_once_are_what_each_is(run: Run, without: tuple[str, ...]) -> None:
    """With torque commands and without, on a banked road, with a gap that no window may touch; of another car."""
    bank = 0.05 * np.sin(run.t)
    changed = dataclasses.replace(run, bank=bank, **dict.fromkeys(without))
    some = windowed(changed, (run.t > 1.5) & (run.t < 1.9))
    assert len(np.unique(np.diff(some.starts))) > 1
    alone, together = one_by_one(some, CAR, OTHER), errors([some], CAR, OTHER)
    assert np.abs(alone[:, -1]).max() > 0.1
    # Internal states may have followed the measured motion for longer, from an earlier window on.
    np.testing.assert_allclose(together, alone, rtol=2e-3, atol=2e-3)
    early = some.starts * some.period < LEAD
    np.testing.assert_allclose(together[early], alone[early], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("count", [2, 3, 11])
def test_cars_together_are_what_each_is(run: Run, count: int) -> None:
    """Of other sizes, tyres, effects and steps; two share the lanes evenly, three and eleven do not."""
    kinds = [(LIVELY.constants(), EFFECTS), (CAR, OTHER), (CARS["coupe"].constants(), Effects(tyre_relaxation=0.3))]
    cars = [kinds[i % 3] for i in range(count)]
    some = windowed(run)
    together = run_errors_of(some, cars)
    for found, (constants, effects) in zip(together, cars, strict=True):
        np.testing.assert_allclose(found, errors([some], constants, effects), rtol=2e-3, atol=2e-3)
    early = some.starts * some.period < LEAD
    alone = [one_by_one(with_starts(some, some.starts[early]), *car) for car in cars[:3]]
    np.testing.assert_allclose(together[:3][:, early], alone, rtol=1e-9, atol=1e-9)


def test_few_windows_and_none(run: Run) -> None:
    """Lanes without a window of their own, and windows that lie far apart."""
    some = windowed(run)
    for starts in (some.starts[:3], some.starts[::9], some.starts[:0]):
        few = with_starts(some, starts)
        np.testing.assert_allclose(errors([few], CAR, EFFECTS), one_by_one(few, CAR, EFFECTS), rtol=2e-3, atol=2e-3)


def test_what_diverges_is_capped(run: Run) -> None:
    lost = dataclasses.replace(windowed(run), y=np.full((len(run), 5), np.nan))
    assert np.all(errors([lost], LIVELY.constants(), EFFECTS) == windows.LARGEST_ERROR)
