"""The experiment on the model's quality: its true curve is the plant's, and it leaves what it promises."""

import json
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.single_track.motion_with_effects import settled_internal_states
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.command_lag import lagged_commands
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.learnt.samples import Samples, concatenate, save_samples
from experiments.benchmarks.vehicles import draw_effects
from experiments.model.quality import QualityConfig, main
from experiments.model.uncertainties import UNCERTAINTIES_AT, model_change, true_change

CAR = VehicleParameters()
STEERING = np.linspace(-0.6, 0.6, 7)


def states_and_inputs() -> tuple[np.ndarray, np.ndarray]:
    at = UNCERTAINTIES_AT
    x = np.tile([at["r"], at["v"], at["beta"], at["omega_r"], 0.0, 0.0], (len(STEERING), 1))
    return x, np.stack([STEERING, np.full_like(STEERING, at["tau"])], axis=1)


def test_the_true_curve_is_the_nominal_cars_without_effects() -> None:
    x, u = states_and_inputs()
    step = NominalStepModel(CAR, substeps=100).step(x, u, u, np.zeros(len(x)))
    change = true_change(STEERING, CAR.constants(), Effects())
    np.testing.assert_allclose(change, (step - x)[:, :4] / 0.1, rtol=0, atol=1e-6)


def test_the_true_curve_is_the_oracles_with_effects() -> None:
    x, u = states_and_inputs()
    effects = draw_effects("held_out", 0, 0)
    internal = np.array(
        [
            settled_internal_states(*row[:4], *command, CAR.constants(), effects)
            for row, command in zip(x, u, strict=True)
        ]
    )
    step = EffectsStepModel(CAR, effects).step(np.hstack([x, internal]), u, u, np.zeros(len(x)))
    change = true_change(STEERING, CAR.constants(), effects)
    np.testing.assert_allclose(change, (step - np.hstack([x, internal]))[:, :4] / 0.1, rtol=0, atol=5e-3)


def test_the_models_curve_is_its_step() -> None:
    model = load_model()
    x, u = states_and_inputs()
    step = step_model(model, model.prior()).step(np.hstack([x, u]), u, u, np.zeros(len(x)))  # settled lags
    mean, deviation = model_change(model, model.prior(), STEERING)
    np.testing.assert_allclose(mean, (step[:, :4] - x[:, :4]) / 0.1, rtol=0, atol=1e-9)
    assert (deviation > model.sigma / 0.1).all()


@pytest.fixture
def drives(tmp_path: Path) -> Path:
    """Made-up drives near a steady drift: what the numbers are does not matter here."""
    for number, population in enumerate(("held_out", "wide")):
        generator = np.random.default_rng(number)
        parts = []
        for drive in range(4):
            x = np.array([0.6, 11.0, -0.5, 15.5, 0.1, 0.0]) + 0.02 * generator.normal(size=(61, 6))
            u = np.array([-0.2, 150.0]) + np.array([0.02, 6.0]) * generator.normal(size=(61, 2))
            x = np.hstack([x, lagged_commands(0.1 * np.arange(61), u)])
            parts.append(Samples(x[:-1], u[:-1], u[1:], x[1:], np.full(60, 0.05), np.zeros(60, dtype=int),
                                 np.full(60, drive)))  # fmt: skip
        save_samples(concatenate(parts), tmp_path / f"{population}.npz")
    return tmp_path


def test_numbers_and_figures_are_left_in_the_folder(drives: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    main(QualityConfig(drives=drives, fixed=None, out=folder))
    numbers = json.loads((folder / "numbers.json").read_text())
    for population in ("held_out", "wide"):
        found = numbers[population]
        assert found["judged"] == 120
        assert set(found["Bayesian"]) == {"0", "1", "2", "5", "10", "20", "50", "100"}
        assert np.shape(found["Bayesian"]["5"]["coverage"]) == (3, 4)
        assert np.shape(found["nominal car"]["rollout_20"]["median"]) == (6,)
        assert set(found["path_step"]) == {"euler_5", "euler_20", "trapezoid_5", "trapezoid_20"}
    for name in ("one_step_errors", "coverage", "rollouts", "uncertainties_held_out", "uncertainties_wide"):
        assert (folder / f"{name}.png").stat().st_size > 10_000
