"""Mistakes of units that are made: a unit read as another one, a wheel's rate for its speed, torque at the axle."""

import dataclasses
from collections.abc import Iterator, Mapping

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.units import DIMENSIONS

RIM_TURNS = (2.0, 33.0)  # [1/m] of wheels of any vehicle
STEERING_RATIOS = (8.0, 25.0)  # steering wheel's angle over road wheel's
WHEEL = "the steering wheel's angle, not the road wheel's"
DISTINCT = 1.5  # factor from one that a mistake must be off by to be distinguished from physics
ANGLES = (("r",), ("psi",), ("beta",), ("delta_cmd",), ("r", "psi"), ("r", "psi", "beta", "delta_cmd"))
SPEEDS = (("v",), ("omega_r",), ("v", "omega_r"))
ACCELERATIONS = (("ax",), ("ay",), ("ax", "ay"))
# Of each kind of column: its dimension and units, SI first, with how rare they are (squared tolerances that one has to
# explain besides), and what they are called.
UNITS: tuple[tuple[tuple[tuple[str, ...], ...], str, dict[str, tuple[float, str]]], ...] = (
    (ANGLES, "angle", {"rad": (0.0, "radians"), "deg": (0.0, "degrees")}),
    (SPEEDS, "speed", {"m/s": (0.0, "m/s"), "km/h": (0.0, "km/h"), "mph": (0.5, "mph"), "kn": (6.0, "knots"),
                       "ft/s": (6.0, "ft/s")}),
    (ACCELERATIONS, "acceleration", {"m/s^2": (0.0, "m/s^2"), "g": (0.0, "g")}),
)  # fmt: skip
TWO_WRONG = 3.0  # in squared tolerances: that a unit was converted from one that it is not either is rarer
OTHERS = (  # columns, the factor, what they look like, and the remedy
    (("tau_cmd",), 1e-3, "kN m", "multiply it by 1000 in the mapping"),
    (("t",), 0.5, "half of the time that passed (a clock at half speed)", "multiply it by 2"),
    (("t",), 2.0, "twice the time that passed (a clock at double speed)", "divide it by 2"),
)


@dataclasses.dataclass(frozen=True)
class Mistake:
    """Columns (`t`: the clock) too large by a factor between `low` and `high`.

    looks_like: the sentence goes on "column r looks like ..."; remedy: "...: divide it by ..."; rarity: what it has to
    explain more than a common one, in squared tolerances.
    """

    columns: tuple[str, ...]
    low: float
    high: float
    looks_like: str
    remedy: str
    rarity: float = 0.0


def mistakes(vehicle: VehicleParameters | None, stated: Mapping[str, str] | None = None) -> list[Mistake]:
    """What is known to be mistaken, but for what this vehicle could not show; without one, of wheels of any size.

    Args:
        stated: the unit that a mapping states, by column: such a column can only have been converted from that one.
    """
    found = list(_of_units(stated or {}))
    found += [Mistake(columns, q, q, like, remedy) for columns, q, like, remedy in OTHERS]
    found.append(Mistake(("delta_cmd",), *STEERING_RATIOS, WHEEL, "divide it by the steering ratio"))
    turns = RIM_TURNS if vehicle is None else (1.0 / vehicle.wheel_radius,) * 2
    found.append(Mistake(("omega_r",), *turns, "the wheel's rad/s, not the rim's m/s", "multiply it by wheel_radius"))
    if vehicle is not None:
        axle, rim = vehicle.gear_ratio, vehicle.gear_ratio / vehicle.wheel_radius
        found.append(Mistake(("tau_cmd",), axle, axle, "torque at the axle, not at the engine",
                             "divide it by gear_ratio in the mapping"))  # fmt: skip
        found.append(Mistake(("tau_cmd",), rim, rim, "the force at the rim [N], not the engine's torque",
                             "multiply it by wheel_radius / gear_ratio in the mapping"))  # fmt: skip
    return [m for m in found if m.low >= DISTINCT or m.high <= 1.0 / DISTINCT]


def _of_units(stated: Mapping[str, str]) -> Iterator[Mistake]:
    """Each unit read as each other one of its kind."""
    for several, dimension, units in UNITS:
        si, sizes = DIMENSIONS[dimension]
        for read, (read_rarity, read_name) in units.items():
            for true, (rarity, name) in units.items():
                if true == read:
                    continue
                given = f"give it in {name}" if true == si else f"give its unit as {name} in the mapping"
                looks = name if read == si else f"{name} converted as if they were {read_name}"
                off = sizes[read] / sizes[true]
                rare = rarity + read_rarity + (TWO_WRONG if si not in (true, read) else 0.0)
                for columns in several:
                    named = {_plain(stated[column]) for column in columns if column in stated} & set(units)
                    if not named:
                        yield Mistake(columns, off, off, looks, given, rare)
                    elif named == {read}:
                        yield Mistake(columns, off, off, looks, given, rarity)


def _plain(unit: str) -> str:
    """A rate of angle is as its angle is."""
    return unit.removesuffix("/s") if unit.endswith(("rad/s", "deg/s")) else unit
