"""A simulator tried for what goes wrong in practice, in some seconds: signs, units, starts, steps, memory, crashes.

What it does is compared with the single-track car that its file gives: not to the percent, but to a factor of what a
unit, a sign or a gear ratio makes.
"""

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np

from drift_drake.car.car_file import read_simulator_car
from drift_drake.car.effects.magnitudes import NO_INTERNAL_STATES, Effects
from drift_drake.car.foreign.asked import CHANNELS, job_of, motion_of
from drift_drake.car.foreign.led_in import OFF, lead_in_needed, trial_of
from drift_drake.car.foreign.pool import cost_of, roll_all
from drift_drake.car.foreign.rollouts import SimulatorError
from drift_drake.car.foreign.signals import LEAD_IN, in_channels
from drift_drake.car.foreign.simulator import FORCES, Simulator, SimulatorConstants
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.single_track.motion_with_effects import motion_with_effects
from drift_drake.common.arrays import Array

ROW, ROWS = 0.01, 81  # [s] between rows of a trial, and how many
BODY = 0.15  # g, of a force on the body
NAMED = {  # factors that a unit or a sign makes, in words
    180.0 / math.pi: "degrees for radians", math.pi / 180.0: "radians for degrees", 3.6: "km/h for m/s",
    1.0 / 3.6: "m/s for km/h", 30.0 / math.pi: "rpm for rad/s", math.pi / 30.0: "rad/s for rpm",
    9.80665: "g for m/s^2", 1000.0: "a factor of 1000", 1e-3: "a factor of 1000",
}  # fmt: skip
ALIKE = 0.12  # of a factor, by which it may be off to be named
FAR = 3.0  # times as much or as little as the car of the file does, from where it is said
NOTHING = 1e-3  # of the expected, below which an input does nothing
SAME = 1e-9  # of a trial's motion, by which the same trial may differ
COARSE = 0.02  # of a trial's motion, by which half the step may change it
LATE = 0.015  # [s] from where on an output is said to lag
MOVED = 0.2  # of a parameter, that it is tried at
NO_INPUTS: Mapping[str, float] = MappingProxyType({})
Grade = Literal["wrong", "doubtful", "good"]


class Finding(NamedTuple):
    """One thing that was tried."""

    grade: Grade
    sentence: str


@dataclasses.dataclass(frozen=True)
class CheckedSimulator:
    """What was found, what the simulator costs, and which effects it cannot have."""

    findings: list[Finding]
    seconds_per_rollout: float
    lacking: dict[str, str]
    seconds: float

    @property
    def wrong(self) -> int:
        """How many findings have to be put right."""
        return sum(one.grade == "wrong" for one in self.findings)


class _Trial:
    """Trials of one simulator: what it does, in SI."""

    def __init__(self, car: SimulatorCar) -> None:
        self.car, self.simulator, self.constants = car, car.simulator, car.constants()
        about = car.single_track()
        _, self.speed, self.steering, self.torque = trial_of(about)
        self.force = BODY * about.mass * about.gravity

    @cached_property
    def rest(self) -> Array:
        """A car that rolls straight on."""
        return self.roll()

    def start(self, **values: float) -> Array:
        """r, v, beta, omega_r, psi [1, 5] of a car that rolls straight on, but for `values`."""
        state = {"r": 0.0, "v": self.speed, "beta": 0.0, "omega_r": self.speed, "psi": 0.0} | values
        return np.array([[state[name] for name in CHANNELS]])

    def roll(
        self, inputs: Mapping[str, float] = NO_INPUTS, constants: SimulatorConstants | None = None, parts: int = 1,
        start: Array | None = None,
    ) -> Array:  # fmt: skip
        """Motion [rows, 5] under steps of inputs, from 0.1 s on; parts: of a row, that the simulator is given."""
        steps = parts * self.simulator.steps_in(ROW)
        rows = (ROWS - 1) * steps + 1
        on = np.clip(np.arange(rows) / (10.0 * steps), 0.0, 1.0)
        values = {name: inputs.get(name, 0.0) * on[None] for name in ("steering", "torque", *FORCES)}
        begin = self.start() if start is None else start
        straight = in_channels(self.start())
        values |= {"measured_speed": np.full((1, rows), self.speed), "measured_yaw_rate": np.zeros((1, rows)),
                   LEAD_IN: np.zeros((1, rows))}  # fmt: skip
        values |= {f"{LEAD_IN}_{name}": np.full((1, rows), q[0]) for name, q in straight.items()}
        job = job_of(constants or self.constants, ROW / steps, begin, values)
        (got,) = roll_all([job])
        return motion_of(self.simulator, got, ROW / steps)[0, ::steps]

    def expected(self, inputs: Mapping[str, float] = NO_INPUTS) -> Array:
        """The same of the single-track car."""
        z, h = self.start()[0], ROW / 5
        out, p = [z], self.car.single_track().constants()
        for row in range(ROWS - 1):
            for step in range(5):
                on = min((row + step / 5) / 10.0, 1.0)
                delta, torque = on * inputs.get("steering", 0.0), on * inputs.get("torque", 0.0)
                wrench = (on * inputs.get(name, 0.0) for name in FORCES)
                m, _ = motion_with_effects(*z[:4], 0.0, NO_INTERNAL_STATES, delta, torque, p, Effects(), *wrench)
                z = z + h * np.array([m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, z[0]])
            out.append(z)
        return np.array(out)


def check_simulator(simulator: str | Path | SimulatorCar) -> CheckedSimulator:
    """Tries a simulator of yours for what goes wrong in practice: signs, units, starts, steps, memory, crashes.

    Examples:
        >>> found = check_simulator("simulator.yaml")  # doctest: +SKIP
        >>> print(found.wrong, found.findings[0].sentence)  # doctest: +SKIP

    Args:
        simulator: path of a simulator file, or what was read from one.

    Returns:
        Findings with a grade and a sentence each, seconds [s] that a roll-out of 0.8 s takes, and the effects that the
        simulator cannot have, with the reason.

    Raises:
        InvalidVehicleError: of the file; SimulatorError: it cannot be loaded, or no roll-out comes back.
    """
    car = simulator if isinstance(simulator, SimulatorCar) else read_simulator_car(simulator)
    began, trial = time.perf_counter(), _Trial(car)
    if not np.all(np.isfinite(trial.rest[:, [i for i, name in enumerate(CHANNELS) if car.simulator.gives(name)]])):
        why = cost_of(car.simulator).why or "its outputs are no finite numbers"
        raise SimulatorError(f"{car.simulator.target}: a car that rolls straight on cannot be simulated: {why}")
    findings = [*_repeated(trial), *_started(trial), *_responses(trial), *_steps(trial), *_lags(trial),
                *_led_in(trial), *_parameters(trial)]  # fmt: skip
    seconds = cost_of(car.simulator).seconds
    return CheckedSimulator(findings, seconds, dict(car.simulator.lacking), time.perf_counter() - began)


def _repeated(trial: _Trial) -> list[Finding]:
    """Whether the same roll-out comes out the same, another one in between."""
    first = trial.roll({"steering": trial.steering})
    trial.roll({"torque": -trial.torque, "steering": -2.0 * trial.steering})
    again = trial.roll({"steering": trial.steering})
    size = np.nanmax(np.abs(first), axis=0) + 1e-12
    apart = float(np.nanmax(np.abs(first - again) / size))
    if not apart <= SAME:
        why = "it draws random numbers, or keeps state from the roll-out before; reset all of it at the start"
        return [Finding("wrong", f"the same roll-out came out different ({100 * apart:.2g} % of its motion): {why}")]
    return [Finding("good", "the same roll-out comes out the same")]


def _started(trial: _Trial) -> list[Finding]:
    """Whether start values are where the motion begins."""
    out, s = [], trial.simulator
    tried = {"r": 0.2 * trial.speed / 12.0, "v": 1.2 * trial.speed, "beta": 0.08, "omega_r": 1.05 * trial.speed}
    for name, value in tried.items():
        if not (s.sets(name) and s.gives(name)):
            continue
        at = CHANNELS.index(name)
        moved = trial.roll(start=trial.start(**{name: value}))[:, at] - trial.rest[:, at]
        wanted = value - (trial.speed if name in ("v", "omega_r") else 0.0)
        share = float(moved[0] / wanted)
        if abs(share - 1.0) < 0.05:
            out.append(Finding("good", f"{name} begins at what is measured"))
        elif abs(share) < 0.05 and np.max(np.abs(moved[1:4] / wanted)) > 0.3:
            row = 1 + int(np.argmax(np.abs(moved[1:4] / wanted) > 0.3))
            out.append(Finding("wrong", f"output {name} shows its start value {row} rows late: it lags; give it before "
                               "the step, not after it"))  # fmt: skip
        elif abs(share) < 0.05:
            out.append(Finding("wrong", f"{name} cannot be set: its start value changes nothing; leave it out of "
                               "start: and give lead_in: 0.3, or name what does set it"))  # fmt: skip
        else:
            out.append(Finding("wrong", f"{name} begins at {share:.3g} times what is measured{_named(share)}; correct "
                               f"unit:, sign: or ratio: of it in start: or outputs:"))  # fmt: skip
    return out


def _named(share: float) -> str:
    """What a factor looks like."""
    signs = " and the other sign" if share < 0.0 else ""
    for factor, words in NAMED.items():
        if abs(abs(share) / factor - 1.0) < ALIKE:
            return f" ({words}{signs})"
    return " (the other sign)" if share < 0.0 and abs(share + 1.0) < 0.5 else ""


def _responses(trial: _Trial) -> list[Finding]:
    """Whether inputs do what they do to the single-track car of the file."""
    p = trial.car.single_track()
    asked = {
        "steering": (trial.steering, "r"),
        "torque": (trial.torque, "v"),
        "force_x": (trial.force, "v"),
        "force_y": (trial.force, "beta"),
        "yaw_moment": (0.2 * trial.force * p.front_axle_distance, "r"),
    }
    expected = trial.expected()
    out = []
    for name, (value, channel) in asked.items():
        if name in trial.simulator.inputs:
            at = CHANNELS.index(channel)
            moved = trial.roll({name: value})[:, at] - trial.rest[:, at]
            wanted = trial.expected({name: value})[:, at] - expected[:, at]
            out.append(_of_share(name, channel, float(np.sum(moved * wanted) / np.sum(wanted**2))))
    return out


def _of_share(name: str, channel: str, share: float) -> Finding:
    """What a response is worth, as a share of the expected one."""
    size = f"{name} moves {channel} by {share:.3g} times what the car under car: does"
    if not math.isfinite(share) or abs(share) < NOTHING:
        return Finding("wrong", f"{name} does nothing to {channel}; name the input that does")
    if share < 0.0:
        return Finding(
            "wrong", f"{size}{_named(share)}; give sign: -1 of the input or of the output (left is positive)"
        )
    if not 1.0 / FAR < share < FAR:
        # How a car answers a force depends on its tyres: a factor alone is no mistake there.
        grade: Grade = "doubtful" if name in FORCES else "wrong"
        hint = _named(share) or ("" if name in FORCES else " (a gear or steering ratio?)")
        return Finding(grade, f"{size}{hint}; correct unit: or ratio:, or the numbers under car:")
    return Finding("good", size)


def _steps(trial: _Trial) -> list[Finding]:
    """Whether half the step gives the same motion."""
    inputs = {"steering": 1.5 * trial.steering, "torque": trial.torque}
    whole, half = trial.roll(inputs), trial.roll(inputs, parts=2)
    step = ROW / trial.simulator.steps_in(ROW)
    if not np.isfinite(half).any():
        return [Finding("doubtful", f"half the step of {1e3 * step:g} ms fails: {cost_of(trial.simulator).why}")]
    size = np.nanmax(np.abs(whole - whole[:1]), axis=0) + 1e-6
    apart = float(np.nanmax(np.nanmax(np.abs(whole - half), axis=0) / size))
    if not apart < COARSE:
        return [Finding("wrong", f"half the step of {1e3 * step:g} ms changes the motion by {100 * apart:.2g} %: it is "
                        f"too long; give step: {0.25 * step:g}, or let the simulator take smaller ones")]  # fmt: skip
    return [Finding("good", f"half the step of {1e3 * step:g} ms changes the motion by {100 * apart:.1g} %")]


def _lags(trial: _Trial) -> list[Finding]:
    """Whether the heading and the yaw rate are of the same time."""
    if "psi" not in trial.simulator.outputs:
        return []
    found = trial.roll({"steering": trial.steering})
    r, psi = found[:, 0], found[:, 4] - found[0, 4]
    turned = np.concatenate([[0.0], np.cumsum(0.5 * ROW * (r[1:] + r[:-1]))])
    if not abs(r[-1]) > 1e-6:
        return []
    slope = float(np.sum(np.diff(psi) * np.diff(turned)) / np.sum(np.diff(turned) ** 2))
    if abs(slope - 1.0) > 0.2:
        return [Finding("wrong", f"psi turns {slope:.3g} times as far as r says{_named(slope)}; correct unit: or sign: "
                        "of one of them")]  # fmt: skip
    late = float((turned[-1] - psi[-1]) / r[-1])
    if abs(late) > LATE:
        first, then = ("psi", "r") if late > 0.0 else ("r", "psi")
        return [Finding("wrong", f"output {first} comes {1e3 * abs(late):.0f} ms later than {then}: it lags; take both "
                        "at the same time")]  # fmt: skip
    return [Finding("good", "psi and r are of the same time")]


def _led_in(trial: _Trial) -> list[Finding]:
    """Whether predictions begin as the simulator would go on, whatever states a start cannot set."""
    needed = lead_in_needed(trial.car)
    if not math.isfinite(needed.off):
        return []  # roll-outs fail, which is said elsewhere
    return [Finding("good" if needed.off < OFF else "doubtful", needed.sentence())]


def _parameters(trial: _Trial) -> list[Finding]:
    """Whether each parameter that has a meaning, or is unknown, can be moved, and does something."""
    s, out, nothing = trial.simulator, [], []
    inputs = {"steering": 2.5 * trial.steering, "torque": 2.0 * trial.torque}
    whole = trial.roll(inputs)
    names = dict.fromkeys([*(name for names in s.meaning.values() for name in names), *s.unknown])
    for name in names:
        for value in _tried(s, trial.constants, name):
            values = trial.constants.by_name() | {name: value}
            found = trial.roll(inputs, trial.constants._replace(values=tuple(values.values())))
            if not np.all(np.isfinite(found[:, :3])):
                why = cost_of(s).why
                out.append(Finding("wrong", f"with {name} of {value:.4g} it fails ({why}); fix it, or give the "
                                   "parameter a smaller deviation"))  # fmt: skip
                break
        else:
            if np.nanmax(np.abs(found - whole) / (np.nanmax(np.abs(whole), axis=0) + 1e-12)) < 1e-7:
                nothing.append(name)
    out += [Finding("doubtful", f"{name} changes nothing in a turn under power: is it the parameter that is meant?")
            for name in nothing]  # fmt: skip
    return out or [Finding("good", f"{len(names)} parameters can be moved, and each does something")]


def _tried(s: Simulator, constants: SimulatorConstants, name: str) -> Sequence[float]:
    """Values of a parameter that calibration may come to."""
    value = s.value_of(name, constants)
    if name in s.unknown:
        return [s.value_of(name, s.deviated(constants, {name: by}, Effects())) for by in (-2.0, 2.0)]
    return [(1.0 - MOVED) * value, (1.0 + MOVED) * value]
