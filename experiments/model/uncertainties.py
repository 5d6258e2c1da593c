"""The figure "uncertainties": what models believe of one step of the car, with the true vehicle's curve laid over."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib

from drift_drake.common.arrays import Array

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from drift_drake.car.effects.magnitudes import Effects, InternalStates
from drift_drake.car.parameters import Constants
from drift_drake.car.single_track.motion_with_effects import motion_with_effects, settled_internal_states
from drift_drake.common.safe_files import write_figure
from drift_drake.drive.learnt.bayesian_step import euler_step
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import TIME_STEP
from drift_drake.drive.learnt.features import features, network_inputs
from drift_drake.drive.learnt.posterior import Posterior, predict

UNCERTAINTIES_AT = {"r": 0.9, "v": 14.5, "beta": -0.45, "omega_r": 21.0, "tau": 200.0}
SUBSTEPS = 100  # of the true vehicle
COLOURS = ("tab:gray", "tab:blue", "tab:green", "tab:purple")


def true_change(steering: Array, nominal: Constants, effects: Effects) -> Array:
    """(x_{k+1} - x_k) / dt of the true vehicle [n, 4] at `UNCERTAINTIES_AT`, commands held, effects settled."""
    at = {name: np.full_like(steering, value) for name, value in UNCERTAINTIES_AT.items()}
    state = np.stack([at["r"], at["v"], at["beta"], at["omega_r"]])
    internal = settled_internal_states(*state, steering, at["tau"], nominal, effects)
    whole = np.concatenate([state, np.stack(np.broadcast_arrays(*internal))])
    start, h = whole.copy(), TIME_STEP / SUBSTEPS

    def rates(q: Array) -> Array:
        motion, change = motion_with_effects(
            *q[:4], 0.0 * q[0], InternalStates(*q[4:]), steering, at["tau"], nominal, effects
        )  # fmt: skip
        return np.stack(np.broadcast_arrays(*motion[:4], *change))

    for _ in range(SUBSTEPS):
        k1 = rates(whole)
        k2 = rates(whole + 0.5 * h * k1)
        k3 = rates(whole + 0.5 * h * k2)
        whole = whole + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rates(whole + h * k3))
    return ((whole - start)[:4] / TIME_STEP).T


def model_change(model: BayesianModel, posterior: Posterior, steering: Array) -> tuple[Array, Array]:
    """(mean [n, 4], standard deviation [n, 4]) of (x_{k+1} - x_k) / dt at `UNCERTAINTIES_AT`."""
    at = UNCERTAINTIES_AT
    u = np.stack([steering, np.full_like(steering, at["tau"])], axis=1)
    state = np.tile([at["r"], at["v"], at["beta"], at["omega_r"], 0.0, 0.0], (len(steering), 1))
    x = np.concatenate([state, u], axis=1)  # the lags are settled
    prediction = predict(posterior, model.sigma, features(model.network, network_inputs(x, u, u)))
    h = euler_step(state, u, np.zeros(len(x)), model.vehicle.constants())[:, :4]
    return (h + prediction.mean - x[:, :4]) / TIME_STEP, np.sqrt(prediction.variance) / TIME_STEP


def draw_uncertainties(
    model: BayesianModel, beliefs: Mapping[str, Posterior], effects: Effects, title: str, file: Path
) -> None:
    """Mean and 3 sigma of beliefs by name, the true vehicle's curve and the nominal car's."""
    steering = np.linspace(-0.6, 0.6, 121)
    nominal = model.vehicle.constants()
    truth = true_change(steering, nominal, effects)
    believed = true_change(steering, nominal, Effects())
    figure, axes = plt.subplots(1, 4, figsize=(15, 3.6), constrained_layout=True)
    names = ("Δr [rad/s²]", "Δv [m/s²]", "Δβ [rad/s]", "Δω_r [m/s²]")
    for i, axis in enumerate(axes):
        for (label, belief), colour in zip(beliefs.items(), COLOURS, strict=False):
            mean, deviation = model_change(model, belief, steering)
            low, high = mean[:, i] - 3.0 * deviation[:, i], mean[:, i] + 3.0 * deviation[:, i]
            axis.fill_between(steering, low, high, color=colour, alpha=0.25, lw=0)
            axis.plot(steering, mean[:, i], color=colour, label=f"{label}, mean ± 3 s.d.")
        axis.plot(steering, truth[:, i], "k--", label="true vehicle")
        axis.plot(steering, believed[:, i], ":", color="tab:red", label="nominal car")
        axis.set_xlabel("δ [rad]")
        axis.set_title(names[i])
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=8)
    figure.suptitle(f"Change over one step; {title}")
    write_figure(figure, file, dpi=110)
    plt.close(figure)
