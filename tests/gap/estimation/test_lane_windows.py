"""Windows of a double-track car, eight at once: what they are one after the other."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.gap.estimation import windows
from drift_drake.gap.estimation.lane_windows import LEAD
from drift_drake.gap.estimation.windows import WindowedRun, errors, windowed
from tests.gap.estimation.test_double_track_windows import EFFECTS, LIVELY, rolled

OTHER = EFFECTS._replace(friction_level=-0.1, front_stiffness_error=0.2, gyro_bias=0.02, drivetrain_friction=40.0)


@pytest.fixture(scope="module")
def run() -> Run:
    return rolled(LIVELY, duration=4.0)


def one_by_one(monkeypatch: pytest.MonkeyPatch, runs: list[WindowedRun], effects: Effects) -> np.ndarray:
    """The same errors, as they are where another package's effects are compiled in."""
    with monkeypatch.context() as patched:
        patched.setattr(windows, "installed_effects", lambda: {"other": None})
        return errors(runs, CARS["roadster"].constants(), effects)


@pytest.mark.parametrize("without", [(), ("tau_cmd",), ("omega_r",)])
def test_eight_at_once_are_what_each_is(run: Run, monkeypatch: pytest.MonkeyPatch, without: tuple[str, ...]) -> None:
    """With torque commands and without, on a banked road, with a gap that no window may touch; of another car."""
    bank = 0.05 * np.sin(run.t)
    changed = dataclasses.replace(run, bank=bank, **dict.fromkeys(without))
    gap = (run.t > 1.5) & (run.t < 1.9)
    some = windowed(changed, gap)
    assert len(np.unique(np.diff(some.starts))) > 1
    alone, together = one_by_one(monkeypatch, [some], OTHER), errors([some], CARS["roadster"].constants(), OTHER)
    assert np.abs(alone[:, -1]).max() > 0.1
    # Internal states have followed the measured motion for a time, where one by one they have from the run's start.
    np.testing.assert_allclose(together, alone, rtol=2e-3, atol=2e-3)
    early = some.starts * some.period < LEAD
    np.testing.assert_allclose(together[early], alone[early], rtol=1e-9, atol=1e-9)


def test_few_windows_and_none(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lanes without a window of their own, and windows that lie far apart."""
    some = windowed(run)
    for starts in (some.starts[:3], some.starts[::9], some.starts[:0]):
        few = dataclasses.replace(some, starts=np.ascontiguousarray(starts))
        together = errors([few], CARS["roadster"].constants(), EFFECTS)
        np.testing.assert_allclose(together, one_by_one(monkeypatch, [few], EFFECTS), rtol=2e-3, atol=2e-3)


def test_what_diverges_is_capped(run: Run) -> None:
    lost = dataclasses.replace(windowed(run), y=np.full((len(run), 5), np.nan))
    assert np.all(errors([lost], LIVELY.constants(), EFFECTS) == windows.LARGEST_ERROR)
