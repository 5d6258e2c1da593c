"""Mistakes that people make with a log's columns, each a factor with a name, and the remedy."""

import dataclasses
import math

from drift_drake.vehicle.parameters import VehicleParameters

DEGREES = 180.0 / math.pi
G = 9.80665
RIM_TURNS = (2.0, 33.0)  # [1/m] of wheels of any vehicle
STEERING_RATIOS = (8.0, 25.0)  # steering wheel's angle over road wheel's
DISTINCT = 2.0  # factor from one that a mistake must be off by to be distinguished from physics
ANGLES = (("r",), ("psi",), ("beta",), ("delta_cmd",), ("r", "psi"), ("r", "psi", "beta", "delta_cmd"))
SPEEDS = (("v",), ("omega_r",), ("v", "omega_r"))
ACCELERATIONS = (("ax",), ("ay",), ("ax", "ay"))
CLOCK, TORQUE = (("t",),), (("tau_cmd",),)
UNITS = (  # columns, alone or together, the factor, what they look like, and the remedy
    (ANGLES, DEGREES, "degrees", "give its unit as degrees in the mapping"),
    (ANGLES, 1.0 / DEGREES, "radians converted as if they were degrees", "give it in radians"),
    (SPEEDS, 3.6, "km/h", "give its unit as km/h in the mapping"),
    (SPEEDS, 1.0 / 3.6, "m/s converted as if they were km/h", "give it in m/s"),
    (SPEEDS, 1.0 / 0.44704, "mph", "give its unit as mph in the mapping"),
    (ACCELERATIONS, 1.0 / G, "g", "give its unit as g in the mapping"),
    (ACCELERATIONS, G, "m/s^2 converted as if they were g", "give it in m/s^2"),
    (TORQUE, 1e-3, "kN m", "multiply it by 1000 in the mapping"),
    (CLOCK, 0.5, "half of the time that passed (a clock at half speed)", "multiply it by 2"),
    (CLOCK, 2.0, "twice the time that passed (a clock at double speed)", "divide it by 2"),
)


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


def mistakes(vehicle: VehicleParameters | None) -> list[Mistake]:
    """What is known to be mistaken, but for what this vehicle could not show; without one, of wheels of any size."""
    found = [Mistake(columns, q, q, *said) for several, q, *said in UNITS for columns in several]
    wheel = ("the steering wheel's angle, not the road wheel's", "divide it by the steering ratio")
    found.append(Mistake(("delta_cmd",), *STEERING_RATIOS, *wheel))
    turns = RIM_TURNS if vehicle is None else (1.0 / vehicle.wheel_radius,) * 2
    found.append(Mistake(("omega_r",), *turns, "the wheel's rad/s, not the rim's m/s", "multiply it by wheel_radius"))
    if vehicle is not None:
        axle, rim = vehicle.gear_ratio, vehicle.gear_ratio / vehicle.wheel_radius
        found.append(Mistake(("tau_cmd",), axle, axle, "torque at the axle, not at the engine",
                             "divide it by gear_ratio in the mapping"))  # fmt: skip
        found.append(Mistake(("tau_cmd",), rim, rim, "the force at the rim [N], not the engine's torque",
                             "multiply it by wheel_radius / gear_ratio in the mapping"))  # fmt: skip
    return [m for m in found if m.low >= DISTINCT or m.high <= 1.0 / DISTINCT]
