"""Real vehicles end to end, on a part of the logs (skipped where they are missing), and the pieces on made-up ones."""

from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.actuated import STAGES, first_order_lag
from drift_drake.car.log.table import Run
from drift_drake.gap.identification.identify import identify
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import read_mapping
from experiments.real.logs import HELD, POSE, RACER, SMALL_CAR, thinned
from experiments.real.steering_steps import steering_of_steps

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the real vehicles' logs are not here (shared/data)")


def test_thinned_rows_keep_their_times():
    t = np.arange(300) * 0.01
    run = thinned(Run("run", t, np.zeros(300), np.ones(300), np.zeros(300), beta=t), 3)
    assert run.period == pytest.approx(0.03)
    np.testing.assert_array_equal(run.beta, run.t)
    assert run.psi is None


def test_offset_and_lag_of_steps_are_found():
    t = np.arange(1000) * 0.01
    command = 0.06 * np.sign(np.sin(2.0 * np.pi * t / 2.5))
    fine = np.interp(np.arange(STAGES * 999 + 1) / STAGES, np.arange(1000), command)
    delta = first_order_lag(fine, command[0], 0.01 / STAGES, 0.12)[::STAGES]
    noise = 0.05 * np.random.default_rng(0).standard_normal(1000)
    run = Run("steps", t, 2.0 * (delta + 0.02) / 0.1735 + noise, np.full(1000, 2.0), command)
    found = steering_of_steps([run, run], 0.1735)
    assert found["lag"]["low"] <= 0.12 <= found["lag"]["high"] < 0.2
    assert found["offset"]["estimate"] == pytest.approx(0.02, abs=0.002)


@needs_data
@pytest.mark.slow
def test_the_small_car_is_identified_on_a_drive_of_its_own():
    recording = sorted((DATA / "dart" / "floor_a").glob("*12_34_30.csv"))
    runs, _ = import_recordings(recording, read_mapping("dart"))
    found = identify([thinned(run.without(*POSE), 2) for run in runs], SMALL_CAR, known=HELD,
                     effects=("steering_lag", "torque_lag"), stated={"r": 0.02, "v": 0.004, "beta": 0.0025},
                     watching=False)  # fmt: skip
    c = found.calibration
    assert c.held_out.high < 1.0
    assert 0.02 < c.parameters["steering_lag"].estimate < 0.3
    friction = c.parameters["friction"]
    assert friction.low < 1.3
    assert friction.high > 0.5


@needs_data
@pytest.mark.slow
def test_the_racer_is_identified_with_its_speed_fed():
    runs, _ = import_recordings(sorted((DATA / "revs_250lm").glob("*.csv")), read_mapping("revs_250lm"), end=40.0)
    found = identify([thinned(run, 2) for run in runs], RACER, known=HELD, effects=("sideslip_bias",), watching=False)
    c = found.calibration
    assert c.held_out.high < 1.0
    assert "gear_ratio" not in c.parameters  # the speed is fed, so nothing that was measured depends on it
    assert "friction" in {name for direction in c.not_identified for name in direction.parts}
