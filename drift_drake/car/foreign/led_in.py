"""How far a simulator's predictions are put off by states that a window's start cannot set, by the lead-in before it.

The simulator weaves; then it is started anew in the midst of that from what its outputs say, as a prediction is started
from a log. Where all its states are set, or have settled in the lead-in, it goes on as it went.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.foreign.along import inputs_along
from drift_drake.car.foreign.asked import CHANNELS, job_along, job_of, motion_of
from drift_drake.car.foreign.pool import roll_all
from drift_drake.car.foreign.signals import LEAD_IN
from drift_drake.car.foreign.simulator import SimulatorConstants
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array

ROW = 0.01  # [s], of a car with a wheelbase of a metre or more; a small one moves faster (Froude's scaling)
LEADS = (0, 20, 40, 80, 120)  # rows that are tried
AHEAD = np.arange(10, 51, 10)  # rows from a start to what is compared: the horizons of a prediction
STARTS, APART = 8, 8  # how many, rows from one to the next
WEAVES = 0.012  # a row
OFF = 0.02  # of what a prediction says to change, from where on unset states are worth a longer lead-in
SPEED = 2.5  # sqrt(g wheelbase), that a trial begins at: 12.7 m/s of a full-size car
TURN, THRUST = 2.0, 1.5  # [m/s^2] that a trial's steering and torque would make
COMPARED = [CHANNELS.index(name) for name in ("r", "beta")]


class Trial(NamedTuple):
    """What a car of this size is tried with."""

    row: float  # [s]
    speed: float  # [m/s]
    steering: float  # [rad]
    torque: float  # of the engine [N m]


def trial_of(about: VehicleParameters) -> Trial:
    """Moderate driving of a single-track car."""
    base = about.front_axle_distance + about.rear_axle_distance
    speed = SPEED * math.sqrt(about.gravity * base)
    steering = min(TURN * base / speed**2, 0.5 * about.steering_limit)
    row = ROW * min(math.sqrt(base), 1.0)
    return Trial(row, speed, steering, THRUST * about.mass * about.wheel_radius / about.gear_ratio)


class Needed(NamedTuple):
    """A lead-in that would do better than the simulator's own, and how far predictions are put off [-] with each."""

    off: float
    lead_in: float  # [s]
    then: float

    @property
    def helps(self) -> bool:
        """Whether it is worth its roll-outs."""
        return self.off >= OFF and self.then < 0.5 * self.off

    def sentence(self) -> str:
        """The figures."""
        size = f"states that a start cannot set put predictions off by {100 * self.off:.2g} % of their change"
        if self.off < OFF:
            return size
        if not self.helps:
            return f"{size}, with other lead-ins too: small changes will not be seen"
        return f"{size}; {100 * self.then:.2g} % with lead_in: {self.lead_in:g}"


def lead_in_needed(car: SimulatorCar) -> Needed:
    """What a lead-in would do for predictions; the simulator's own where it is enough, NaN where roll-outs fail."""
    own, usual = car.simulator.lead_in, trial_of(car.single_track())
    woven = weave(car.constants(), usual._replace(torque=0.5 * usual.torque))
    off = put_off(woven, [own])[own]
    if not off >= OFF:
        return Needed(off, own, off)
    tried = put_off(woven, [lead for rows in LEADS if (lead := float(f"{rows * usual.row:.2g}")) != own])
    shares = {own: off} | {lead: share for lead, share in tried.items() if math.isfinite(share)}
    enough = [lead for lead, share in shares.items() if share < OFF]
    best = min(enough) if enough else min(shares, key=lambda lead: shares[lead])
    return Needed(off, best, shares[best])


def led_in(car: SimulatorCar) -> tuple[SimulatorCar, list[str]]:
    """The car with the lead-in that it needs where its file names none, and what is to be said of it."""
    needed = lead_in_needed(car)
    if not needed.helps:
        return car, []
    if LEAD_IN in car.simulator.data:
        return car, [needed.sentence()]
    simulator = car.simulator.led_in(needed.lead_in)
    return dataclasses.replace(car, simulator=simulator), [f"{needed.sentence()}, which is used"]


class Weave(NamedTuple):
    """A simulator that weaves: its motion [rows, 5], and its inputs along that."""

    constants: SimulatorConstants
    row: float  # [s]
    motion: Array
    inputs: dict[str, Array]


def weave(constants: SimulatorConstants, tried: Trial) -> Weave:
    """The motion to start anew in; tried: where it begins, amplitude of the steering, steady torque."""
    s, q, row = constants.simulator, Effects(), tried.row
    longest = max(*LEADS, round(s.lead_in / row))
    rows = longest + STARTS * APART + AHEAD[-1] + 1
    commands = tried.steering * np.sin(2.0 * np.pi * WEAVES * np.arange(rows)), np.full(rows, tried.torque)
    straight = np.tile([0.0, tried.speed, 0.0, tried.speed, 0.0], (rows, 1))
    inputs, dt = inputs_along(commands, straight, row, constants, q), row / s.steps_in(row)
    (got,) = roll_all([job_of(constants, dt, straight[:1], {name: values[None] for name, values in inputs.items()})])
    motion = motion_of(s, got, dt)[0, :: s.steps_in(row)]
    motion = np.where([s.gives(name) for name in CHANNELS], motion, motion[:, [0, 1, 2, 1, 4]])  # a rim as the car
    return Weave(constants, row, motion, inputs_along(commands, motion, row, constants, q))


def put_off(woven: Weave, leads: Sequence[float]) -> dict[float, float]:
    """By lead-in [s]: error of how r and beta change within 50 rows (the larger), as a share of that change."""
    s, row, motion = woven.constants.simulator, woven.row, woven.motion
    begin = len(motion) - 1 - AHEAD[-1] - APART * np.arange(STARTS)
    true = motion[begin[:, None] + AHEAD] - motion[begin][:, None]
    rows = [round(lead / row) for lead in leads]
    jobs = [job_along(woven.constants, row, motion, woven.inputs, begin - n, n, n + AHEAD[-1]) for n in rows]
    out = {}
    for lead, n, got in zip(leads, rows, roll_all(jobs), strict=True):
        found = motion_of(s, got, row / s.steps_in(row))[:, :: s.steps_in(row)]
        wrong = found[:, n + AHEAD] - found[:, [n]] - true
        shares = np.mean(wrong**2, axis=(0, 1)) / (np.mean(true**2, axis=(0, 1)) + 1e-12)
        out[lead] = float(np.sqrt(np.max(shares[COMPARED])))
    return out
