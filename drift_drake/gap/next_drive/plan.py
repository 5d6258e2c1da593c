"""What to drive next: the manoeuvre that tells best which of the hypotheses that a log left is true.

Candidates are plans of the optimal control problem with the T-optimal cost (`drive.mpc.discrimination`) for the leading
hypothesis against its rivals, from several first guesses, and plain drives (straight on, slaloms). The
one is taken after which the true hypothesis is expected to have the highest probability, as the diagnosis's own
filter foresees it (`foresight`): it knows transport delays, a road's grade and all sensors, which a one-step
model cannot have and for which the plans' model has stand-ins.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drift_drake.car.effects.catalogue import HEADED
from drift_drake.car.effects.delays import command_delays, sensor_delay
from drift_drake.car.effects.magnitudes import Effects, magnitudes_of
from drift_drake.car.internal_states import BEYOND
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.single_track.motion_with_effects import settled_internal_states
from drift_drake.common.errors import significant
from drift_drake.common.safe_files import write_table
from drift_drake.drive.gathering.config import FEASIBLE, LaneDrive, bound_slip, problem_data
from drift_drake.drive.mpc.discrimination import (
    CarHypothesis,
    DiscriminationCost,
    Rival,
    RivalsStepModel,
    gains_and_biases,
)
from drift_drake.drive.mpc.ocp import OcpWeights, OptimalControlProblem
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.mpc.sqp import LineSearchSqp, SqpOptions
from drift_drake.gap.diagnosis.answers.answer import Answer, UnplannableError
from drift_drake.gap.diagnosis.likelihood.beliefs import Belief, Sensing
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.fit import MAGNITUDE_STEP
from drift_drake.gap.estimation.prior import bounds, scale
from drift_drake.gap.estimation.problem import NUISANCE_STEP, NUISANCES, Problem, car, tolerance_deviations
from drift_drake.gap.next_drive.foresight import PERIOD, REFITS, Commands, beliefs_of, foresee, probability_of_truth

ROWS = round(DT / PERIOD)
RIVALS = 3  # of the leading hypothesis that plans are made against
ROUNDING = 1e-5  # of an answer written to a file
OUT_OF_LANE = 0.05  # [m] of a plan's largest slack
HEADINGS = (0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi)  # [rad] of the lane that are tried where a road's grade is in doubt
SLALOMS = ((1.0, 2.4), (1.5, 1.5))  # [m], [s]


@dataclasses.dataclass(frozen=True)
class NextDriveConfig(LaneDrive):
    """The lane, and how plans are sought."""

    alpha: float = 10.0  # weight of log(1 + nats)
    starts: int = 2  # first guesses for each rival
    max_iterations: int = 60
    weights: OcpWeights = dataclasses.field(default_factory=lambda: OcpWeights(delta=100.0, tau=3e-4, e=0.5))


@dataclasses.dataclass(frozen=True)
class NextDrive:
    """A drive to be, and what it is expected to tell."""

    x: np.ndarray  # [N+1, 6]: r, v, beta, omega_r, e, dphi
    u: np.ndarray  # [N+1, 2], linear in between
    heading: float  # [rad] of the lane in the fixed frame of the logs
    kind: str  # discrimination, straight or slalom
    names: tuple[str, ...]  # hypotheses that it is to tell apart, most probable first
    nats: np.ndarray  # [truths, rivals] log evidence that a rival is expected to lose
    before: float  # probability of the true one among them, expected
    after: float

    @property
    def sigmas(self) -> float:
        """By how many standard deviations the leading hypothesis and its first rival differ, at the least."""
        return float(np.sqrt(2.0 * min(self.nats[0, 1], self.nats[1, 0])))

    def expectations(self) -> dict[str, Any]:
        """What the drive is expected to tell, as plain data."""
        return {
            "kind": self.kind,
            "hypotheses": list(self.names),
            "nats": self.nats.tolist(),
            "probability_before": self.before,
            "probability_after": self.after,
            "sigmas": self.sigmas,
        }

    def commands(self) -> Commands:
        """At 100 Hz, as the actuator interpolates them."""
        t = np.arange(ROWS * (len(self.u) - 1) + 1) / ROWS
        knots = np.arange(len(self.u))
        delta, tau = (np.interp(t, knots, self.u[:, i]) for i in range(2))
        return Commands(delta, tau, float(self.x[0, 1]), self.heading)

    def table(self) -> pd.DataFrame:
        """The commands, and the states that they are expected to lead to (linear between plan points), at 100 Hz."""
        commands = self.commands()
        t = np.arange(len(commands.delta))
        knots = ROWS * np.arange(len(self.x))
        columns = {"t": t * PERIOD, "delta_cmd": commands.delta, "tau_cmd": commands.tau}
        states = {name: np.interp(t, knots, self.x[:, i]) for i, name in enumerate((*CHANNELS[:4], "e", "dphi"))}
        return pd.DataFrame(columns | states).round(6)

    def write(self, path: str | Path) -> None:
        """Writes the table as CSV."""
        write_table(self.table(), path, index=False)

    def sentence(self) -> str:
        """What the drive is for and what it promises."""
        towards = f", heading {np.degrees(self.heading):.0f} degrees in the logs' frame" if self.heading else ""
        first, second, *others = self.names
        more = f" (and from {', '.join(others)})" if others else ""
        return (
            f"{len(self.x[1:]) * DT:.1f} s from {self.x[0, 1]:.1f} to {self.x[-1, 1]:.1f} m/s{towards}, to distinguish "
            f"{first} from {second}{more}: {second} is expected to fall behind by {significant(self.nats[0, 1])} nats "
            f"if {first} is true, {first} by {significant(self.nats[1, 0])} if {second} is ({self.sigmas:.1f} sigma "
            f"at the least), and the true one to have a probability of {self.after:.2f}, after {self.before:.2f} now."
        )


def plan_from_answer(
    answer: Answer, vehicle: VehicleParameters, config: NextDriveConfig | None = None, own: Effects | None = None,
    diagnosed: Effects | None = None,
) -> NextDrive:  # fmt: skip
    """The drive that follows an answer: T-optimal for its hypotheses (Atkinson and Fedorov 1975).

    Args:
        answer: with two open hypotheses; vehicle: that was diagnosed; config: the lane, and how plans are sought;
        own: effects of the vehicle file; without, those that the answer was found with; diagnosed: those of the file
            that was diagnosed, where `vehicle` and `own` are a single-track car that stands for a double-track one.

    Raises:
        UnplannableError: the answer does not hold two hypotheses to distinguish, or was found with other effects in the
            vehicle file; no plan keeps within the lane. InvalidAnswerError: what the answer says of them is no belief.

    Examples:
        >>> drive = plan_from_answer(read_answer("open.json"), car)  # doctest: +SKIP
        >>> drive.before, drive.after  # doctest: +SKIP
    """
    sensing, beliefs = beliefs_of(answer)
    if own is not None:
        file = own if diagnosed is None else diagnosed
        if "own" in answer.details["beliefs"] and not np.allclose(file, sensing.own, rtol=ROUNDING, atol=0.0):
            raise UnplannableError(
                f"{answer.case}: the answer was found with effects of the vehicle file ({listed(sensing.own)}) that "
                f"are not this file's ({listed(file)}); give the file that was diagnosed with"
            )
        sensing = dataclasses.replace(sensing, own=own)
    return plan_next(vehicle, sensing, beliefs, config)


def listed(effects: Effects) -> str:
    """What there is, for a message."""
    return ", ".join(f"{name} {value:g}" for name, value in magnitudes_of(effects).items()) or "none"


def plan_next(
    vehicle: VehicleParameters, sensing: Sensing, beliefs: Sequence[Belief], config: NextDriveConfig | None = None
) -> NextDrive:
    """The candidate with the highest expected probability of the true hypothesis; of equals, the most sigmas.

    Args:
        beliefs: two hypotheses at least, most probable first.

    Raises:
        UnplannableError: no candidate keeps within the lane.
    """
    config = config or NextDriveConfig()
    plans = list(candidates(vehicle, sensing, beliefs, config))
    if not plans:
        raise UnplannableError("no plan keeps within the lane; widen it or lower the final speed")
    best = max(plans, key=lambda plan: (round(plan.after, 3), plan.sigmas))
    return foreseen(best, vehicle, sensing, beliefs, REFITS)


def candidates(
    vehicle: VehicleParameters, sensing: Sensing, beliefs: Sequence[Belief], config: NextDriveConfig
) -> Iterator[NextDrive]:
    """All plans that keep within the lane, with what they are expected to tell by a linearised look ahead."""
    graded = any(HEADED.intersection(belief.names) for belief in beliefs)
    headings = HEADINGS if graded else HEADINGS[:1]
    names = tuple(belief.name for belief in beliefs)
    for kind, x, u in trajectories(vehicle, sensing, beliefs, config):
        for heading in headings:
            plan = NextDrive(x, u, heading, kind, names, np.zeros((len(names), len(names))), 0.0, 0.0)
            yield foreseen(plan, vehicle, sensing, beliefs, 0)


def foreseen(
    plan: NextDrive, vehicle: VehicleParameters, sensing: Sensing, beliefs: Sequence[Belief], refits: int
) -> NextDrive:
    """A plan with what it is expected to tell."""
    probabilities = np.array([belief.probability for belief in beliefs])
    nats = foresee(vehicle, sensing, beliefs, plan.commands(), refits)
    before, after = (probability_of_truth(probabilities, n) for n in (np.zeros_like(nats), nats))
    return dataclasses.replace(plan, nats=nats, before=before, after=after)


def trajectories(
    vehicle: VehicleParameters, sensing: Sensing, beliefs: Sequence[Belief], config: NextDriveConfig
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """(kind, states, inputs) of plans for the leading hypothesis's car."""
    t = np.arange(config.steps + 1) * DT
    plain: list[tuple[str, np.ndarray | None]] = [("straight", None)]
    plain += [("slalom", size * np.sin(2.0 * np.pi * t / period)) for size, period in SLALOMS]
    for kind, lateral in plain:
        for x, u in solved_plans(
            vehicle, sensing, beliefs[:2], dataclasses.replace(config, alpha=0.0, starts=1), lateral
        ):
            yield kind, x, u
    for rival in beliefs[1 : 1 + RIVALS]:
        for x, u in solved_plans(vehicle, sensing, (beliefs[0], rival), config):
            yield "discrimination", x, u


def solved_plans(
    vehicle: VehicleParameters,
    sensing: Sensing,
    pair: Sequence[Belief],
    config: NextDriveConfig,
    lateral: np.ndarray | None = None,
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Plans (states [N+1, 6], inputs [N+1, 2]) of the OCP from each first guess that leads to one within the lane."""
    first, rival = (as_rival(vehicle, sensing.own, belief) for belief in pair)
    own, other = first.car(first.theta), rival.car(rival.theta)
    gain, bias = (np.array(q) for q in state_map(own, other))
    step_models = [EffectsStepModel(vehicle, c.effects).of_car(c.constants, c.effects) for c in (own, other)]
    model = RivalsStepModel(step_models[0], step_models[1], gain, bias)
    cost = DiscriminationCost(model, own, rival, stage_deviation(sensing), config.alpha)
    problem = OptimalControlProblem(
        model, vehicle, config.steps, config.weights, extra_cost=cost if config.alpha > 0.0 else None
    )
    bound_slip(problem, config)
    data = problem_data(config, lateral)
    start = data.x_init
    settled = [
        np.array(settled_internal_states(*s[:4], *data.u_init, c.constants, c.effects), dtype=float)
        for c, s in ((own, start), (other, start * gain + bias))
    ]
    data = data._replace(x_init=np.concatenate([start, *settled]))
    problem.set(data)
    options = SqpOptions(max_iterations=config.max_iterations, tolerance=1e-3, gauss_newton=True)
    solver = LineSearchSqp(problem, options)
    rng = np.random.default_rng(0)
    straight = problem.first_guess(data)
    for _ in range(config.starts):
        x, u, _ = problem.unstack(straight)
        if config.alpha > 0.0:  # straight on, nothing tells what hypotheses make of steering: a saddle of the cost
            u[1:, 0] = 0.06 * np.sin(np.arange(config.steps) * rng.uniform(0.2, 0.6) + rng.uniform(0.0, 2.0 * np.pi))
            u[1:, 1] = rng.uniform(50.0, 250.0)
        result = solver.solve(problem.stack(x, u))
        x, u, slack = problem.unstack(result.z)
        if not result.failed and result.primal_residual < FEASIBLE and np.max(slack) < OUT_OF_LANE:
            yield x[:, :6], u


def state_map(own: CarHypothesis, other: CarHypothesis) -> tuple[np.ndarray, np.ndarray]:
    """(gain, bias) from the state of one hypothesis to that which the other takes its sensors' reading for."""
    (own_gain, own_bias), (gain, bias) = gains_and_biases(own.sensors), gains_and_biases(other.sensors)
    return own_gain / gain, (own_bias - bias) / gain


def stage_deviation(sensing: Sensing) -> np.ndarray:
    """Standard deviations [4] of the difference between a stage's end and its prediction.

    Both ends are known to the mean of half a stage's rows; the process wanders in between.
    """
    ends = 2.0 * sensing.noise[:4] ** 2 / (0.5 * ROWS)
    variance = (ends + sensing.process[:4] * DT) / sensing.tempering
    return np.asarray(np.sqrt(np.where(sensing.used[:4], variance, 1e6)))


def as_rival(vehicle: VehicleParameters, own: Effects, belief: Belief) -> Rival:
    """A belief as `drive.mpc.discrimination` wants it; `own` are the vehicle file's effects."""
    tolerance = tolerance_deviations(vehicle)
    problem = Problem([], vehicle, vehicle.constants(), tolerance, np.ones(9), np.ones(9), own=own)
    whiten = np.linalg.inv(belief.root)

    def car_of(theta: np.ndarray) -> CarHypothesis:
        constants, effects = car(problem, theta, belief.names)
        return CarHypothesis(constants, stand_ins(effects), effects)

    count = len(NUISANCES)
    ends = [bounds(name, problem.vehicle) for name in belief.names]
    steps = [MAGNITUDE_STEP * scale(name, problem.vehicle) for name in belief.names]
    return Rival(
        car_of,
        belief.theta,
        whiten.T @ whiten,
        np.concatenate([np.full(count, NUISANCE_STEP), steps]),
        np.concatenate([np.full(count, -np.inf), [low for low, _ in ends]]),
        np.concatenate([np.full(count, np.inf), [high for _, high in ends]]),
    )


def stand_ins(effects: Effects) -> Effects:
    """Effects that a one-step model can have: delays as lags, a road's grade as a resistance, no sensors."""
    q: Mapping[str, Any] = effects._asdict()
    late, (late_steering, late_torque) = sensor_delay(effects), command_delays(effects)
    return effects._replace(
        steering_lag=q["steering_lag"] + max(late_steering + late, 0.0),
        torque_lag=q["torque_lag"] + max(late_torque + late, 0.0),
        rolling_resistance=q["rolling_resistance"] + float(np.sin(q["road_grade"])),
        **dict.fromkeys((*BEYOND, *HEADED), 0.0),
    )
