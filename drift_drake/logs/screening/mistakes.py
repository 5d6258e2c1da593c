"""Mistakes that people make with a log's columns, each a factor with a name, and the remedy."""

import dataclasses
import math

from drift_drake.vehicle.parameters import VehicleParameters

DEGREES = 180.0 / math.pi
G = 9.80665
STEERING_RATIOS = (8.0, 25.0)  # steering wheel's angle over road wheel's
DISTINCT = 2.0  # factor from one that a mistake must be off by to be distinguished from physics


@dataclasses.dataclass(frozen=True)
class Mistake:
    """Columns (`t`: the clock) too large by a factor between `low` and `high`.

    looks_like: the sentence goes on "column r looks like ..."; remedy: "...: divide it by ...".
    """

    columns: tuple[str, ...]
    low: float
    high: float
    looks_like: str
    remedy: str


def mistakes(vehicle: VehicleParameters) -> list[Mistake]:
    """What is known to be mistaken, the commonest first; those that this vehicle could not show are left out."""
    radius, ratio = vehicle.wheel_radius, vehicle.gear_ratio
    found = []
    for columns in (("r",), ("psi",), ("beta",), ("delta_cmd",), ("r", "psi"), ("r", "psi", "beta", "delta_cmd")):
        found.append(_exact(columns, DEGREES, "degrees", "give its unit as degrees in the mapping"))
        found.append(_exact(columns, 1.0 / DEGREES, "radians converted as if they were degrees", "give it in radians"))
    for columns in (("v",), ("omega_r",), ("v", "omega_r")):
        found.append(_exact(columns, 3.6, "km/h", "give its unit as km/h in the mapping"))
        found.append(_exact(columns, 1.0 / 3.6, "m/s converted as if they were km/h", "give it in m/s"))
        found.append(_exact(columns, 1.0 / 0.44704, "mph", "give its unit as mph in the mapping"))
    found.append(
        _exact(("omega_r",), 1.0 / radius, "the wheel's rad/s, not the rim's m/s", "multiply it by wheel_radius")
    )
    for columns in (("ax",), ("ay",), ("ax", "ay")):
        found.append(_exact(columns, 1.0 / G, "g", "give its unit as g in the mapping"))
        found.append(_exact(columns, G, "m/s^2 converted as if they were g", "give it in m/s^2"))
    wheel = ("the steering wheel's angle, not the road wheel's", "divide it by the steering ratio")
    found.append(Mistake(("delta_cmd",), *STEERING_RATIOS, *wheel))
    found.append(
        _exact(("tau_cmd",), ratio, "torque at the axle, not at the engine", "divide it by gear_ratio in the mapping")
    )
    found.append(
        _exact(("tau_cmd",), ratio / radius, "the force at the rim [N], not the engine's torque",
               "multiply it by wheel_radius / gear_ratio in the mapping")
    )  # fmt: skip
    found.append(_exact(("tau_cmd",), 1e-3, "kN m", "multiply it by 1000 in the mapping"))
    found.append(_exact(("t",), 0.5, "half of the time that passed (a clock at half speed)", "multiply it by 2"))
    found.append(_exact(("t",), 2.0, "twice the time that passed (a clock at double speed)", "divide it by 2"))
    return [m for m in found if m.low >= DISTINCT or m.high <= 1.0 / DISTINCT]


def _exact(columns: tuple[str, ...], factor: float, looks_like: str, remedy: str) -> Mistake:
    return Mistake(columns, factor, factor, looks_like, remedy)
