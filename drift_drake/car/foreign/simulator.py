"""What is known of a simulator of the user's, and what its parameters mean of a car."""

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from drift_drake.car.deviation import Deviation
from drift_drake.car.effects.catalogue import CATALOGUE, PARAMETRIC
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.effects.record import Effect
from drift_drake.car.foreign.signals import LEAD_IN, SimulatorSignal
from drift_drake.car.parameters import Constants
from drift_drake.car.single_track.motion_with_effects import changed_constants

Kind = Literal["python", "drake", "fmu"]


MEANINGS = tuple(dict.fromkeys(change.meaning for effect in CATALOGUE.values() for change in effect.changes))
"""Of a simulator's parameters, that effects act through."""
STEERING, TORQUE = ("steering", "torque")
FORCES = ("force_x", "force_y", "yaw_moment")


@dataclasses.dataclass(frozen=True)
class Simulator:
    """A simulator as its file describes it; `written` is that description as JSON, with absolute paths."""

    kind: Kind
    target: str  # `module:function`, or an FMU's path
    folder: str  # that modules are imported from
    batch: bool
    step: float  # [s] at most, between two rows of its inputs
    lead_in: float  # [s]
    limit: float  # [s] that one roll-out may take
    windows: int  # that predictions are asked for at most; 0: as many as its cost allows
    set_state: str  # `module:function` of a Drake system, or empty
    inputs: Mapping[str, SimulatorSignal]
    outputs: Mapping[str, SimulatorSignal]
    start: Mapping[str, SimulatorSignal]
    parameters: tuple[str, ...]
    meaning: Mapping[str, tuple[str, ...]]
    unknown: Mapping[str, Deviation]
    reference_gear: float  # gear ratio of the car that the file describes: more of it is more torque
    written: str

    @cached_property
    def key(self) -> str:
        """Tells it from any other: a hash of its description."""
        return hashlib.sha256(f"{self.folder} {self.written}".encode()).hexdigest()

    @property
    def data(self) -> dict[str, Any]:
        """The description, as in its file."""
        return dict(json.loads(self.written))

    def led_in(self, seconds: float) -> "Simulator":
        """The same with another lead-in [s]."""
        return dataclasses.replace(self, lead_in=seconds, written=json.dumps(self.data | {LEAD_IN: seconds}))

    @cached_property
    def lacking(self) -> dict[str, str]:
        """Effects that it cannot have, and why."""
        found = {name: self._why_not(effect) for name, effect in CATALOGUE.items()}
        return {name: why for name, why in found.items() if why}

    def _why_not(self, effect: Effect) -> str:
        """What it lacks for an effect; empty where it can have it."""
        if effect.rate is not None:
            return "it has a state of its own, which a simulator of yours cannot be given"
        if effect.changes:
            lacks = [change.meaning for change in effect.changes if change.meaning not in self.meaning]
            enough = len(lacks) < len(effect.changes) if effect.any_of_them else not lacks
            return "" if enough else f"no parameter is said to be {' or '.join(lacks)}"
        if effect.force is not None:
            lacks = [one for one in forces_of(effect) if one not in self.inputs]
            return f"no input {' and '.join(lacks)}" if lacks else ""
        if effect.stage == "sensor":
            lacks = [one for one in effect.needs if one not in ("psi", "r") and not self.gives(one)]
            return f"no output {' and '.join(lacks)}" if lacks else ""
        # Every simulator has inputs for both commands.
        around = effect.by_torque or effect.stage in ("actuator", "command")
        return "" if around else "it is inside the simulator's equations"

    def gives(self, channel: str) -> bool:
        """Whether its outputs say a channel of a log: r, v, beta, omega_r or psi."""
        return _holds(self.outputs, channel) or (channel == "psi" and "r" in self.outputs)

    def sets(self, channel: str) -> bool:
        """Whether a roll-out can begin at a measured channel."""
        return _holds(self.start, channel)

    def steps_in(self, period: float) -> int:
        """Rows of its inputs from one row of a log to the next, `period` [s] later."""
        return max(math.ceil(period / self.step - 1e-9), 1)

    def left_out(self) -> list[str]:
        """What it cannot have and why, a sentence a reason."""
        names: dict[str, list[str]] = {}
        for name, why in self.lacking.items():
            names.setdefault(why, []).append(name)
        return [f"{', '.join(some)} ({why})" for why, some in names.items()]

    # What `car.equations.kind_of` gives of any car:

    label = "simulator of yours"

    @property
    def lacks(self) -> tuple[str, ...]:
        return tuple(self.lacking)

    @property
    def deviations(self) -> Mapping[str, Deviation]:
        return self.unknown

    @property
    def folded(self) -> tuple[str, ...]:
        return tuple(name for name, effect in CATALOGUE.items() if name in PARAMETRIC or effect.changes)

    def value_of(self, name: str, constants: "SimulatorConstants") -> float:
        """A parameter by its name."""
        return constants.values[self.parameters.index(name)]

    def deviated(
        self, constants: "SimulatorConstants", by: Mapping[str, float], effects: Effects  # noqa: ARG002
    ) -> "SimulatorConstants":  # fmt: skip
        """The car with its unknown parameters so many standard deviations off."""
        values = dict(zip(self.parameters, constants.values, strict=True))
        values |= {name: one.moved(values[name], by.get(name, 0.0)) for name, one in self.unknown.items()}
        return constants._replace(values=tuple(values.values()))

    def changed_constants(self, constants: "SimulatorConstants", effects: Effects) -> "SimulatorConstants":
        """The car with the effects that change its parameters."""
        values = dict(zip(self.parameters, constants.values, strict=True))
        for name, effect in CATALOGUE.items():
            q = float(getattr(effects, name))
            for change in effect.changes if q else ():
                for own in self.meaning.get(change.meaning, ()):
                    by = change.sign * q
                    values[own] = values[own] * (1.0 + by) if change.relative else values[own] + by
        about = changed_constants(constants.about, effects)
        return constants._replace(values=tuple(values.values()), about=about)


def _holds(signals: Mapping[str, SimulatorSignal], channel: str) -> bool:
    """Whether signals say a channel, the speed and the sideslip by v_x and v_y too."""
    return channel in signals or (channel in ("v", "beta") and {"v_x", "v_y"} <= set(signals))


def forces_of(effect: Effect) -> list[str]:
    """Inputs that a further force on the body acts through, found by its physics at one motion."""
    assert effect.force is not None
    car = Constants(1000.0, 1500.0, 1.2, 1.3, 0.3, 20.0, 10.0, 1.0, 1e5, 1e5, 9.81, 0.0, 0.0)
    wrench = effect.force(0.5, 10.0, 0.2, 9.0, 0.7, car, 0.1)
    return [name for name, part in zip(FORCES, wrench, strict=True) if part != 0.0]


class SimulatorConstants(NamedTuple):
    """A simulator with its parameters' values, and the single-track car that is about it."""

    simulator: Simulator
    values: tuple[float, ...]
    about: Constants

    def __getattr__(self, name: str) -> Any:
        """Mass, friction and other numbers of the car about it."""
        if name in Constants._fields:
            return getattr(self.about, name)
        raise AttributeError(name)

    @property
    def torque_gain(self) -> float:
        """Times the torque that the log commands."""
        return float(self.about.gear_ratio / self.simulator.reference_gear)

    def by_name(self) -> dict[str, float]:
        """The parameters' values."""
        return dict(zip(self.simulator.parameters, (float(q) for q in np.asarray(self.values)), strict=True))
