"""A road's bank that a log gives: a force on the body that is known, where else it is one constant and unknown."""

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.common.arrays import Array

NO_WRENCH = np.empty((0, 3))


def bank_force(bank: Array, mass: float, gravity: float, effects: Effects) -> tuple[Effects, Array]:
    """The effects that are left once a logged bank acts as a force, and that force [N] along the body's y [rows].

    Args:
        bank: [rad] of the road, its left side higher, one a row [rows]; mass: without the effects' error of it [kg];
        gravity: [m/s^2].
    """
    weight = mass * (1.0 + effects.mass_error) * gravity
    return effects._replace(road_bank=0.0), np.asarray(-weight * np.sin(bank * (1.0 + effects.road_bank)))


def on_road(bank: Array | None, mass: float, gravity: float, effects: Effects) -> tuple[Effects, Array]:
    """`bank_force` from each row to the next, as a wrench; without a bank (None) `road_bank` stays an effect.

    Returns:
        (effects, force (F_x, F_y) [N] and yaw moment [N m] from each row to the next [rows, 3]; no rows without a bank)
    """
    if bank is None:
        return effects, NO_WRENCH
    left, force = bank_force(bank, mass, gravity, effects)
    wrench = np.zeros((len(bank), 3))
    wrench[:-1, 1], wrench[-1, 1] = 0.5 * (force[:-1] + force[1:]), force[-1]
    return left, wrench


def with_bank(wrench: Array, banked: Array) -> Array:
    """The sum of two wrenches [rows, 3], either of them without rows where there is none."""
    if not len(banked):
        return wrench
    return banked + wrench if len(wrench) else banked
