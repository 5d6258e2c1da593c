"""The cars of a monitor's bank: each the simulator's car with one effect at one magnitude, or one further force."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.diagnosis.shared.ranges import RATE_LIMIT
from drift_drake.estimation.unknowns import added
from drift_drake.vehicle.catalogue import CATALOGUE, wheelbase
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters

SIGNED_AT = 0.5  # of the end of the practical range
CURVED = ("friction_level", "front_rear_friction_split", "front_stiffness_error", "rear_stiffness_error")
"""Signed effects that act otherwise upwards than downwards: tyres saturate."""
UNSIGNED_AT = 0.5
SPREAD_AT = (0.3, 0.8)  # of the practical range, in logarithms
LIMITS_AT = (0.0, 0.5, 1.0)
PUSH = 0.05  # of the car's weight: the forces that no effect stands for
FORCES = ("force_x", "force_y", "moment")


@dataclasses.dataclass(frozen=True)
class Node:
    """One car of the bank, and what is believed of its amplitude: a normal, which is cut at zero unless `signed`.

    An amplitude of one is the node's own magnitude; in between, an effect acts in proportion.
    """

    name: str  # of the effect, or of the force
    magnitude: float
    mean: float  # of the amplitude
    deviation: float
    signed: bool = False
    push: tuple[float, float, float] = (0.0, 0.0, 0.0)  # force [N] and moment [N m] on the body

    def magnitude_at(self, amplitude: float) -> float:
        """The magnitude that an amplitude stands for."""
        if self.name == RATE_LIMIT:
            return self.magnitude / max(amplitude, 0.1)
        return self.magnitude * (amplitude if self.signed else max(amplitude, 0.0))

    def car(self, own: Effects) -> Effects:
        """The simulator's effects with this node's."""
        return own if self.name in FORCES else added(own, {self.name: self.magnitude})


def effect_nodes(name: str, vehicle: VehicleParameters) -> list[Node]:
    """Nodes of one effect: both signs, or spread over the range where an effect is far from linear."""
    info = CATALOGUE[name]
    low, high = info.range_for(vehicle)
    if info.signed and name in CURVED:  # the practical range's end is one standard deviation
        return [Node(name, SIGNED_AT * end, 0.0, 1.0 / SIGNED_AT) for end in (low, high)]
    if info.signed:
        return [Node(name, SIGNED_AT * high, 0.0, 1.0 / SIGNED_AT, signed=True)]
    if name == RATE_LIMIT:
        return [Node(name, float(low * (high / low) ** share), 1.0, 0.3) for share in LIMITS_AT]
    if info.spread:
        return [Node(name, float(low * (high / low) ** share), 1.0, 0.6) for share in SPREAD_AT]
    return [Node(name, UNSIGNED_AT * high, 0.0, 1.0 / UNSIGNED_AT)]


def make_nodes(names: Sequence[str], vehicle: VehicleParameters) -> list[Node]:
    """Nodes of the effects `names`, then those of the forces that stand for what is unknown."""
    weight = PUSH * vehicle.mass * vehicle.gravity
    pushes = [Node(name, 1.0, 0.0, 1.0, True, tuple(push)) for name, push in
              zip(FORCES, np.diag([weight, weight, weight * wheelbase(vehicle)]).tolist(), strict=True)]  # fmt: skip
    return [node for name in names for node in effect_nodes(name, vehicle)] + pushes
