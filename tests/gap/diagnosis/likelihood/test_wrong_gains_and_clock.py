"""The car's own equations: wrong gains, a banked road and a wrong clock are named, with the whole catalogue at hand."""

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.likelihood.diagnose import diagnose
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth

CAR = VehicleParameters()
DEVIATIONS = {"mass": 0.01, "friction": -0.02, "wheel_radius": 0.002}


def answered(name, q, seed):
    runs = make_case(Truth({name: q}, {}, DEVIATIONS), CAR, np.random.default_rng(seed), 5.0)
    return diagnose(runs, CAR, workers=1).answer


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "q"),
    [
        ("steering_ratio_error", 0.2),
        ("steering_ratio_error", -0.06),
        ("gyro_gain_error", -0.04),
        ("speed_gain_error", 0.04),
        ("road_bank", 0.08),
        ("command_clock_error", 0.05),
    ],
)
def test_each_is_named_with_its_magnitude(name, q):
    answer = answered(name, q, 3)
    assert answer.causes == [name]
    found = answer.magnitudes[name]
    assert found.low - 0.02 * abs(q) <= q <= found.high + 0.02 * abs(q)


@pytest.mark.slow
def test_an_early_clock_and_late_sensors_share_what_no_log_tells_apart():
    answer = answered("command_clock_error", -0.05, 3)
    both = ("command_clock_error", "sensor_latency")
    assert CATALOGUE[both[0]].below_zero == both[1]
    assert set(both) <= set(answer.ambiguity)
    assert sum(answer.posterior[name] for name in both) > 0.9
