"""Drake's plants and the compiled one tell the same story; the blind check's books are kept."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from experiments.benchmarks.compiled_cases import simulate_run
from experiments.benchmarks.drake_cases import drive
from experiments.benchmarks.drivers import Driver
from experiments.benchmarks.intervals import binomial
from experiments.benchmarks.scores import scores
from experiments.benchmarks.truths import Truth, drawn_truth

VEHICLE = VehicleParameters()


@pytest.mark.parametrize(
    "truth",
    [
        Truth({"steering_lag": 0.08, "aero_drag": 1.0}, {}, {"mass": 0.01, "steering_offset": 0.001}),
        Truth({}, {"crosswind": 600.0, "driveline_oscillation": 0.3}),
    ],
)
def test_drakes_plant_and_the_compiled_one_drive_alike(truth):
    kind = "transients"
    one = drive(Driver(kind, np.random.default_rng(5), VEHICLE), truth, VEHICLE, 3, "a", 0.6)
    other = simulate_run(
        Driver(kind, np.random.default_rng(5), VEHICLE), truth, VEHICLE, np.random.default_rng(0), "a", 0.6
    )
    assert len(one) == len(other)
    # The drivers' commands differ by a row; motion and noise account for the rest.
    assert np.max(np.abs(one.r - other.r)) < 0.2
    assert np.max(np.abs(one.v - other.v)) < 0.3


def test_a_seed_repeats_a_run_to_the_bit():
    truth = drawn_truth(np.random.default_rng(1), "tolerance", VEHICLE)
    runs = [drive(Driver("slalom", np.random.default_rng(5), VEHICLE), truth, VEHICLE, 3, "a", 0.6) for _ in range(2)]
    np.testing.assert_array_equal(runs[0].r, runs[1].r)
    np.testing.assert_array_equal(runs[0].tau_cmd, runs[1].tau_cmd)


def test_scores_count_what_they_say():
    def answer(causes, verdict, name, low=0.0, high=1.0):
        return {
            "causes": causes,
            "verdict": verdict,
            "posterior": {name: 0.9, "none": 0.1},
            "ambiguity": [name],
            "magnitudes": {c: {"estimate": 0.5, "low": low, "high": high} for c in causes},
            "reduction": {"estimate": 0.98, "low": 0.9, "high": 1.0},
            "seconds": 1.0,
        }

    def label(tier, effects, strange=None):
        return {"case": "x", "tier": tier, "effects": effects, "strange": strange or {}}

    pairs = [
        (label("exact", {"aero_drag": 0.6}), answer(["aero_drag"], "effect", "aero_drag")),
        (label("exact", {"mass_error": 0.1}), answer(["aero_drag"], "effect", "aero_drag")),
        (label("none", {}), answer([], "none", "none")),
        (label("family", {}, {"crosswind": 1.0}), answer([], "unknown", "unknown")),
    ]
    result = scores(pairs)
    assert result["top-1"]["exact"]["share"] == 0.5
    assert result["false alarms"]["share"] == 0.0
    assert result["unknown, recalled"]["share"] == 1.0
    assert result["magnitude coverage"]["count"] == 1
    assert len(result["mistakes"]) == 1
    assert binomial(19, 20, "wilson")[1] == pytest.approx(0.764, abs=1e-3)
