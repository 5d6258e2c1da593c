"""The books of the corrected closed loop."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from experiments.benchmarks.truths import Truth
from experiments.gap.corrected_loop import picture, real_car, summarise, table


def result(real: float, corrected: float) -> dict[str, object]:
    def run(e: float) -> dict[str, object]:
        return {"rms_e": e, "rms_sideslip_error": 0.1 * e, "completion": 1.0, "completed": True, "outcome": "completed"}

    runs = {"real": run(real), "real again": run(real), "nominal": run(0.1), "corrected": run(corrected)}
    return {"vehicle": 0, "tier": "pair", "said": "none", "right": False, "runs": runs}


def test_a_simulator_that_forecasts_the_car_is_distinguished_from_one_that_does_not():
    results = [result(e, 1.1 * e) for e in (0.2, 0.5, 1.0)]
    summary = summarise(results)
    assert summary["corrected"]["rms_e"]["median absolute error"] == pytest.approx(0.05)
    assert summary["corrected"]["rms_e"]["Spearman"] == pytest.approx(1.0)
    assert summary["nominal"]["rms_e"]["median absolute error"] == pytest.approx(0.4)
    assert np.isnan(summary["nominal"]["rms_e"]["Spearman"])
    assert "| corrected | 0.0500" in table(summary)
    assert len(picture(results).axes) == 3


def test_the_real_car_has_its_deviations_and_effects():
    car, effects = real_car(
        Truth({"aero_drag": 1.0}, {}, {"mass": 0.01, "steering_offset": 0.002}), VehicleParameters()
    )
    assert car.mass == pytest.approx(1.01 * VehicleParameters().mass)
    assert (effects.aero_drag, effects.steering_offset) == (1.0, 0.002)
