"""A bank of filters that runs along with the car: the simulator's car, and the same car with each effect.

One extended Kalman filter of the simulator's car (`estimation.filter`) gives the gain and the whitening of every row;
all cars of the bank are corrected with that gain. The whitened innovations of the first car are white noise of variance
one where the simulator is right. Where an effect acts with an amplitude a, their mean is a times the difference between
the first car's innovations and those of the car that has the effect: its signature (Willsky and Jones 1976; for
constant parameters the same as Friedland's separated filter, 1969).
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.actuated import STAGES, first_order_lag, limited_steering, without_actuators
from drift_drake.car.compilation import compiled, copied
from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS, wheelbase
from drift_drake.car.effects.delays import check_causal, command_delays, sensor_delay
from drift_drake.car.effects.magnitudes import COUNT, Effects, depends_on_heading
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.scalar import fixed_tuple
from drift_drake.car.single_track.motion_with_effects import road_wheel
from drift_drake.gap.estimation.filter import UNMEASURED, correct, measurement_matrix, propagate, update_covariance
from drift_drake.gap.estimation.filter_state import (
    CORRECTED,
    MEASURED,
    SIZE,
    SUBSTEPS,
    advance_row,
    first_state,
    linearise,
    predict_measurement,
    rates_of,
    transition,
)
from drift_drake.gap.estimation.unknowns import added

SIGNED_AT = 0.5  # of the end of the practical range
UNSIGNED_AT = 0.5
SPREAD_AT = (0.3, 0.8)  # of the practical range, in logarithms
LIMITS_AT = (0.0, 0.5, 1.0)
FORCE_SHARE = 0.05  # of the car's weight: the forces that no effect stands for
FORCES = ("force_x", "force_y", "moment")
CONSTANTS = len(Constants._fields)
FAR = 16.0  # root of a row's squared innovations, in standard deviations; beyond twice the clipping of `monitor`
LEFT_OUT = 0.05  # [s] of rows that are left out, then they are believed
REGAINED = 0.1  # of the time that passes with rows that are not left out


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
    wrench: tuple[float, float, float] = (0.0, 0.0, 0.0)  # force [N] and moment [N m] on the body

    def magnitude_at(self, amplitude: float) -> float:
        """The magnitude that an amplitude stands for."""
        if self.name in LIMITS:
            return self.magnitude / max(amplitude, 0.1)
        return self.magnitude * (amplitude if self.signed else max(amplitude, 0.0))

    def car(self, own: Effects) -> Effects:
        """The simulator's effects with this node's."""
        return own if self.name in FORCES else added(own, {self.name: self.magnitude})


def effect_nodes(name: str, vehicle: VehicleParameters) -> list[Node]:
    """Nodes of one effect: both signs, or spread over the range where an effect is far from linear."""
    info = CATALOGUE[name]
    low, high = info.range_for(vehicle)
    if info.signed and info.saturates:  # the practical range's end is one standard deviation
        return [Node(name, SIGNED_AT * end, 0.0, 1.0 / SIGNED_AT) for end in (low, high)]
    if info.signed:
        # Live, no command is known ahead: what hastens them is linear from its other side.
        end = low if info.hastens else high
        return [Node(name, SIGNED_AT * end, 0.0, 1.0 / SIGNED_AT, signed=True)]
    if info.limit:
        return [Node(name, float(low * (high / low) ** share), 1.0, 0.3) for share in LIMITS_AT]
    if info.spread:
        return [Node(name, float(low * (high / low) ** share), 1.0, 0.6) for share in SPREAD_AT]
    return [Node(name, UNSIGNED_AT * high, 0.0, 1.0 / UNSIGNED_AT)]


def make_nodes(names: Sequence[str], vehicle: VehicleParameters) -> list[Node]:
    """Nodes of the effects `names`, then those of the forces that stand for what is unknown."""
    weight = FORCE_SHARE * vehicle.mass * vehicle.gravity
    wrenches = [Node(name, 1.0, 0.0, 1.0, True, tuple(wrench)) for name, wrench in
              zip(FORCES, np.diag([weight, weight, weight * wheelbase(vehicle)]).tolist(), strict=True)]  # fmt: skip
    return [node for name in names for node in effect_nodes(name, vehicle)] + wrenches


class Bank(NamedTuple):
    """What does not change: the cars [m], the first of them the simulator's, and the filter's noise."""

    period: float  # [s] between rows
    constants: np.ndarray  # [len(Constants)]
    effects: np.ndarray  # [m, COUNT]
    dynamic: np.ndarray  # [m, COUNT] without those of actuators
    delays: np.ndarray  # [m, 2] of steering and torque [rows]
    wrenches: np.ndarray  # [m, 3]
    noise: np.ndarray  # [9] variances of the channels
    process: np.ndarray  # [9] variances a second


class BankState(NamedTuple):
    """What is carried from row to row."""

    z: np.ndarray  # [m, SIZE] states of the cars
    actuators: np.ndarray  # [m, 2] road-wheel angle before its offset [rad], engine torque [N m]
    p: np.ndarray  # [9, 9] covariance of the first car
    jacobian: np.ndarray  # [15, 9] of the first car's rates, at the last prediction
    commands: np.ndarray  # [rows kept, 2], newest last
    reading: np.ndarray  # [9] last measurement
    predicted: np.ndarray  # [9] what the first car predicted of it


def make_bank(
    nodes: Sequence[Node], vehicle: VehicleParameters, own: Effects, period: float, noise: np.ndarray,
    process: np.ndarray,
) -> Bank:  # fmt: skip
    """The bank of a simulator's car, vehicle and own effects; noise [9], process [9]: variances.

    Raises:
        InvalidVehicleError: by its own effects, commands would act before they are given.
    """
    check_causal(own, "the calibrated car", sensor_delay(own))
    cars = [own, *(node.car(own) for node in nodes)]
    delays = [[(late + sensor_delay(q)) / period for late in command_delays(q)] for q in cars]
    return Bank(
        period, np.array(vehicle.constants(), dtype=float), np.array(cars, dtype=float),
        np.array([without_actuators(q) for q in cars], dtype=float), np.array(delays),
        np.array([(0.0, 0.0, 0.0), *(node.wrench for node in nodes)]), noise, process,
    )  # fmt: skip


def on_bank(bank: Bank, angle: float) -> Bank:
    """The bank of filters on a road that is known to be banked [rad], its left side higher."""
    if angle == 0.0:
        return bank
    constants = Constants(*bank.constants)
    weights = constants.mass * constants.gravity * (1.0 + bank.effects[:, Effects._fields.index("mass_error")])
    wrenches = bank.wrenches.copy()
    wrenches[:, 1] -= weights * np.sin(angle)
    return bank._replace(wrenches=wrenches)


def make_state(bank: Bank) -> BankState:
    """A state to be filled by `start`."""
    m, kept = len(bank.effects), int(np.ceil(bank.delays.max())) + 2
    return BankState(np.zeros((m, SIZE)), np.zeros((m, 2)), np.zeros((CORRECTED, CORRECTED)),
                     np.zeros((SIZE + 2, CORRECTED)), np.zeros((kept, 2)), np.zeros(MEASURED),
                     np.zeros(MEASURED))  # fmt: skip


@compiled
def start_bank(y: Any, used: Any, command: Any, bank: Any, state: Any) -> Any:
    """Puts all cars into the measured state y [9] (`CHANNELS`; `used`: which are measured), settled at the command."""
    constants = Constants(*fixed_tuple(bank.constants, CONSTANTS))
    for j in range(len(state.z)):
        effects = Effects(*fixed_tuple(bank.dynamic[j], COUNT))
        delta = road_wheel(command[0], Effects(*fixed_tuple(bank.effects[j], COUNT)))
        first_state(y, used, delta, command[1], constants, effects, state.z[j])
        state.actuators[j, 0], state.actuators[j, 1] = delta, command[1]
    for row in range(len(state.commands)):
        copied(command, state.commands[row])
    state.p[:] = 0.0
    for i in range(4):
        state.p[i, i] = bank.noise[i] if used[i] else UNMEASURED
    for i in range(3):
        state.p[4 + i, 4 + i] = bank.noise[6 + i] if used[6 + i] else 0.0
    own = Effects(*fixed_tuple(bank.dynamic[0], COUNT))
    if own.tyre_relaxation > 0.0:
        state.p[7, 7] = state.p[8, 8] = 1e-4
    _linearised(state.z[0], state.actuators[0, 0], command[1], constants, own, state.jacobian)


@compiled
def _linearised(z: Any, delta: Any, torque: Any, constants: Any, effects: Any, jacobian: Any) -> Any:
    probe = np.zeros(SIZE)
    relaxed, graded = effects.tyre_relaxation > 0.0, depends_on_heading(effects)
    linearise(z, delta, torque, constants, effects, relaxed, graded, probe, jacobian)


@compiled
def _late(commands: Any, column: Any, delay: Any, out: Any) -> Any:
    """The command `delay` rows ago, over the last row, on the stages' grid."""
    last = len(commands) - 1
    for i in range(STAGES + 1):
        place = max(last - 1 + i / STAGES - delay, 0.0)
        row = min(int(place), last - 1)
        out[i] = commands[row, column] + (place - row) * (commands[row + 1, column] - commands[row, column])


@compiled
def _actuated(bank: Any, state: Any, j: Any, delta: Any, torque: Any) -> Any:
    """Road-wheel angle and torque of car j over the last row; carries its actuators on."""
    effects = Effects(*fixed_tuple(bank.effects[j], COUNT))
    step = bank.period / STAGES
    _late(state.commands, 0, bank.delays[j, 0], delta)
    copied(road_wheel(delta, effects), delta)
    _late(state.commands, 1, bank.delays[j, 1], torque)
    if effects.steering_rate_limit > 0.0:
        copied(limited_steering(delta, state.actuators[j, 0], step, effects), delta)
    elif effects.steering_lag > 0.0:
        copied(first_order_lag(delta, state.actuators[j, 0], step, effects.steering_lag), delta)
    if effects.torque_lag > 0.0:
        copied(first_order_lag(torque, state.actuators[j, 1], step, effects.torque_lag), torque)
    state.actuators[j, 0], state.actuators[j, 1] = delta[-1], torque[-1]


@compiled
def _row(y: Any, used: Any, command: Any, bank: Any, state: Any, innovations: Any) -> Any:
    n, m = CORRECTED, MEASURED
    constants = Constants(*fixed_tuple(bank.constants, CONSTANTS))
    delta, torque, k, w = np.empty(STAGES + 1), np.empty(STAGES + 1), np.zeros(SIZE + 2), np.zeros((2, SIZE))
    f, t, scratch, s, low = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros((m, m)), np.zeros((m, m))
    h, ph, gain, whitening = np.zeros((m, n)), np.zeros((m, n)), np.zeros((n, m)), np.zeros((m, m))
    predicted, nu = np.zeros(m), np.zeros(m)
    for row in range(len(state.commands) - 1):
        copied(state.commands[row + 1], state.commands[row])
    copied(command, state.commands[-1])
    transition(state.jacobian, bank.period, n, f, t, scratch, 0.0)
    propagate(f, bank.process, bank.period, n, state.p, t, 0.0)
    for j in range(len(state.z)):
        effects, z = Effects(*fixed_tuple(bank.dynamic[j], COUNT)), state.z[j]
        _actuated(bank, state, j, delta, torque)
        advance_row(z, delta, torque, 0, bank.period, SUBSTEPS, constants, effects, bank.wrenches[j], k, w)
        rates_of(z, delta[-1], torque[-1], constants, effects, bank.wrenches[j], k)
        predict_measurement(z, k[SIZE], k[SIZE + 1], effects, predicted)
        if j == 0:
            copied(y, state.reading)
            copied(predicted, state.predicted)
            _linearised(z, delta[-1], torque[-1], constants, effects, state.jacobian)
            measurement_matrix(effects, h)
            copied(state.jacobian[SIZE], h[4, :n])
            copied(state.jacobian[SIZE + 1], h[5, :n])
            update_covariance(h, bank.noise, used, n, state.p, gain, whitening, ph, s, low, t, 0.0)
        correct(y, used, predicted, gain, whitening, nu, z, innovations[j], 0.0, 0.0)


def advance_bank(y: np.ndarray, used: np.ndarray, command: np.ndarray, bank: Bank, state: BankState) -> np.ndarray:
    """Carries the state one row on, in place, to a measurement and the command in force there.

    Returns:
        Whitened innovations [m, 9] of all cars; zero in channels that are not `used`.
    """
    innovations = np.empty((len(bank.effects), MEASURED))
    _row(y, used, command, bank, state, innovations)
    return innovations


def allowance(bank: Bank) -> float:
    """Rows that may be left out at the start."""
    return max(round(LEFT_OUT / bank.period), 1)


def gated_row(
    bank: Bank, state: BankState, left: float, y: np.ndarray, used: np.ndarray, command: np.ndarray
) -> tuple[BankState, np.ndarray | None, float]:
    """The bank one row on; a row that is left out is predicted through.

    A reading that jumps would move the filter's state, and the rows after it would look like a change of the car. So a
    row that is too far off for any change is left out, but only a few at a time: what goes on being far off is
    believed, the car may have met a wall.

    Args:
        left: rows that may be left out; y [9], used [9], command [2]: as `bank.row` takes them.

    Returns:
        (the state, the whitened innovations [m, 9] or None where the row was left out, rows that may be left out).
    """
    after = _copy(state)
    innovations = advance_bank(y, used, command, bank, after)
    if left < 1.0 or float(np.sum(innovations[0][used] ** 2)) <= FAR**2:
        return after, innovations, min(left + REGAINED, allowance(bank))
    after = _copy(state)
    advance_bank(y, np.zeros_like(used), command, bank, after)
    return after, None, left - 1.0


def _copy(state: BankState) -> BankState:
    return BankState(*(a.copy() for a in state))
