"""Inputs of a simulator along measured motion: commands, with what actuators make of them, and forces on the body."""

import numpy as np

from drift_drake.car.actuated import STAGES, actuated, without_actuators
from drift_drake.car.effects.magnitudes import NO_INTERNAL_STATES, Effects, actuation_of, with_forces
from drift_drake.car.foreign.signals import LEAD_IN, in_channels
from drift_drake.car.foreign.simulator import FORCES, STEERING, TORQUE, SimulatorConstants
from drift_drake.car.road import NO_WRENCH, on_road, with_bank
from drift_drake.car.single_track.motion_with_effects import axle_torque
from drift_drake.common.arrays import Array


def inputs_along(
    commands: tuple[Array, Array], motion: Array, period: float, constants: SimulatorConstants, effects: Effects,
    bank: Array | None = None, wrench: Array = NO_WRENCH,
) -> dict[str, Array]:  # fmt: skip
    """Inputs by quantity [(rows - 1) * steps + 1], SI, along a whole run; steps: `Simulator.steps_in` its period.

    Args:
        commands: road-wheel angle [rad] and engine torque [N m], each [rows]; motion: r, v, beta, omega_r, psi
            [rows, 5], SI, sensors' errors taken out; period: between rows [s]; effects: those that are no parameters of
            the simulator; bank: of the road [rows, rad]; wrench: further force
            (F_x, F_y) [N] and yaw moment [N m] on the body [rows, 3], none with zero rows.
    """
    rows, steps = len(motion), constants.simulator.steps_in(period)
    before = (float(commands[0][0]), float(commands[1][0]))
    delta, torque = actuated(*commands, before, period, effects)
    fine = np.arange((rows - 1) * steps + 1) / steps
    delta, torque = (between(grid, STAGES * fine) for grid in (delta, torque))
    along = between(motion, fine)
    rest, banked = on_road(bank, constants.mass, constants.gravity, without_actuators(effects))
    gear, radius = constants.about.gear_ratio, constants.about.wheel_radius
    torque = axle_torque(torque * constants.torque_gain, along[:, 3], gear, radius, rest) / gear
    delta, torque = actuation_of(delta + rest.steering_offset, torque, along[:, 1], rest, NO_INTERNAL_STATES)
    si = {STEERING: delta, TORQUE: torque, "measured_speed": along[:, 1], "measured_yaw_rate": along[:, 0]}
    si |= {LEAD_IN: np.zeros(len(fine))} | {f"{LEAD_IN}_{name}": q for name, q in in_channels(along).items()}
    own = with_forces(*(along[:, i] for i in range(5)), constants.about, rest, NO_INTERNAL_STATES, (0.0, 0.0, 0.0))
    further = with_bank(wrench, banked)
    for i, name in enumerate(FORCES):
        si[name] = np.broadcast_to(np.asarray(own[i], dtype=float), fine.shape)
        if len(further):
            si[name] = si[name] + further[np.minimum(fine.astype(int), rows - 1), i]
    return si


def between(values: Array, places: Array) -> Array:
    """Linear between rows; places [...] count them."""
    low = np.minimum(places.astype(int), len(values) - 2)
    share = (places - low)[(...,) + (None,) * (values.ndim - 1)]
    return np.asarray(values[low] + share * (values[low + 1] - values[low]))
