"""Real vehicles identified on a part of their logs (skipped where they are missing)."""

from pathlib import Path

import pytest

from drift_drake.gap.identification.identify import identify
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import read_mapping
from experiments.real.cars import RACER, SMALL_CAR

HELD = ("mass", "wheel_radius", "rear_axle_inertia")
# What the small car's x, y and psi say is in r, v and beta already, which are their derivatives.
POSE = ("x", "y", "psi")
DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the real vehicles' logs are not here (shared/data)")


@needs_data
@pytest.mark.slow
def test_the_small_car_is_identified_on_a_drive_of_its_own():
    recording = sorted((DATA / "dart" / "floor_a").glob("*12_34_30.csv"))
    runs, _ = import_recordings(recording, read_mapping("dart"))
    found = identify([run.without(*POSE).thinned(2) for run in runs], SMALL_CAR, known=HELD,
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
    found = identify([run.thinned(2) for run in runs], RACER, known=HELD, effects=("sideslip_bias",), watching=False)
    c = found.calibration
    assert c.held_out.high < 1.0
    assert "gear_ratio" not in c.parameters  # the speed is fed, so nothing that was measured depends on it
    assert "friction" in {name for direction in c.not_identified for name in direction.parts}
