"""What a drive that is planned for information is: along which lane, by which objective, within which limits."""

import dataclasses
from typing import Literal

import numpy as np

from drift_drake.car.step_model import INPUT_SCALE, STATE_SCALE
from drift_drake.common.arrays import Array
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.learnt.bayesian_step import PathStep
from drift_drake.drive.learnt.command_lag import LAGGED
from drift_drake.drive.manoeuvres.steering_check import USUAL_STEERING, Steering
from drift_drake.drive.mpc.ocp import OcpData, OcpWeights, OptimalControlProblem
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.qp.qp import QpMethod
from drift_drake.drive.qp.stages import StageRows
from drift_drake.drive.reference.trajectory import Reference, straight_line

SLOWEST, FASTEST = 1.0, 60.0  # [m/s] of a plan's ends
WIDEST = 50.0  # [m] of a lane to either side
FEASIBLE = 1e-2  # largest gap in a plan's dynamics, in scaled variables (0.1 m/s, 0.005 rad), that the feedback absorbs
SIDESLIP_SOFTENING = 0.3  # [rad] over the limit that cost as much as 1 m over the lane's edge
SLIP_SOFTENING = 5.0  # [m/s], likewise
# How an informative plan ends, as weights of the states and a limit to either side: yaw rate [rad/s], sideslip and
# course [rad], and the rear rim's slip over the ground [m/s].
ENDS = (({0: 1.0}, 0.2), ({2: 1.0}, 0.05), ({5: 1.0}, 0.1), ({3: 1.0, 1: -1.0}, 2.0))
RATE_SHARE = 0.8  # of the steering's rate that a plan uses; what is left is the feedback's
END_SOFTENING = 0.3  # of a limit that costs as much as 1 m over the lane's edge
# What a plan is to tell: l_info of eq. (9); the same with the covariance updated along the horizon; of drifts to come.
Objective = Literal["eq8", "updated", "drifts"]


@dataclasses.dataclass(frozen=True)
class LaneDrive:
    """The paper's section IV-A: from 7.5 to 20 m/s along a straight line in 4.5 s."""

    steps: int = 45  # of 0.1 s
    v_start: float = 7.5  # [m/s]
    v_end: float = 20.0  # [m/s]
    half_width: float = 3.0  # [m] of the lane
    margin: float = 0.5  # [m] that plans keep from the lane's edge
    min_speed: float = 6.0  # [m/s] in plans: models are unsure of a crawl, and it tells nothing of a drift
    max_slip: float = 8.0  # [m/s] of the rear rim over the ground in plans
    max_sideslip: float = 0.2  # [rad] in plans; the true car's has been up to half as much again

    def __post_init__(self) -> None:
        for name in ("v_start", "v_end"):
            if not SLOWEST <= getattr(self, name) <= FASTEST:
                raise InvalidOptionError(f"{name} is {getattr(self, name):g} m/s; give {SLOWEST:g} to {FASTEST:g}")
        if not self.margin < self.half_width <= WIDEST:
            raise InvalidOptionError(
                f"half_width is {self.half_width:g} m; give above {self.margin:g}, up to {WIDEST:g}"
            )


def problem_data(config: LaneDrive, lateral: Array | None = None) -> OcpData:
    """The lane's middle, or a line e(t) [N+1] [m] off it, as an OCP's data."""
    n = config.steps
    reference = np.zeros((n + 1, 6))
    reference[:, 1] = reference[:, 3] = np.linspace(config.v_start, config.v_end, n + 1)
    if lateral is not None:
        reference[:, 4] = lateral
        reference[:, 5] = np.gradient(lateral, DT) / reference[:, 1]
    lane = np.full(n + 1, config.half_width - config.margin)
    start = np.array([0.0, config.v_start, 0.0, config.v_start, 0.0, 0.0])
    return OcpData(start, np.zeros(2), reference, np.zeros(n), -lane, lane)


def bound_slip(problem: OptimalControlProblem, config: LaneDrive) -> None:
    """Bounds speed from below, wheel spin and sideslip: plans stay where models hold and the car can be caught.

    Softened by the lane's slack, so that a linearised problem always has a solution.
    """
    stages = np.arange(1, config.steps + 1)
    for what, weights, limit, softening, signs in (
        ("sideslip", {2: 1.0}, config.max_sideslip, SIDESLIP_SOFTENING, (1.0, -1.0)),
        ("wheel spin", {3: 1.0, 1: -1.0}, config.max_slip, SLIP_SOFTENING, (1.0, -1.0)),
        ("least speed", {1: 1.0}, -config.min_speed, SLIP_SOFTENING, (-1.0,)),
    ):
        for sign in signs:
            row = softened(problem, weights, sign, softening)
            rows = np.tile(row, (config.steps, 1))
            below, limits = np.full(config.steps, -np.inf), np.full(config.steps, limit)
            problem.bound(StageRows(f"{what}, softened", stages, rows, below, limits))


def softened(problem: OptimalControlProblem, weights: dict[int, float], sign: float, softening: float) -> Array:
    """A row [n+3] of weighted states, of which a slack of 1 m takes `softening`."""
    row = np.zeros(problem.layout.state_size + 3)
    for state, weight in weights.items():
        row[state] = sign * weight * STATE_SCALE[state]
    row[-1] = -softening
    return row


def bound_end(problem: OptimalControlProblem) -> None:
    """Bounds how the drive ends, so that a car which drives on can be kept in the lane. Softened as `bound_slip` is."""
    last = np.full(2, problem.horizon)
    for weights, limit in ENDS:
        rows = np.array([softened(problem, weights, sign, END_SOFTENING * limit) for sign in (1.0, -1.0)])
        problem.bound(StageRows("straight at the end, softened", last, rows, np.full(2, -np.inf), np.full(2, limit)))


def bound_steering(problem: OptimalControlProblem, steering: Steering, lag: float) -> None:
    """Bounds the rate of the road wheel, which a command is ahead of by the rate times the lag [s] behind it."""
    stages, ahead = np.arange(1, problem.horizon + 1), RATE_SHARE * steering.rate * lag
    row = np.zeros(problem.layout.state_size + 3)
    row[LAGGED.start], row[-3] = -problem.layout.state_scale[LAGGED.start], INPUT_SCALE[0]
    limit = np.full(problem.horizon, ahead)
    problem.bound(StageRows("rate of the steering", stages, np.tile(row, (problem.horizon, 1)), -limit, limit))


@dataclasses.dataclass(frozen=True)
class GatheringConfig(LaneDrive):
    """A lane drive that is worth learning from (section IV-A of the paper), its plans and the rounds.

    Raises:
        InvalidOptionError: a number out of its range; it names the option and the range.

    Examples:
        >>> GatheringConfig(steps=30).half_width
        3.0
    """

    # Bolder than where only a nominal car plans: on validation vehicles, drives up to here taught most about drifting.
    max_sideslip: float = 0.35  # [rad] in plans
    alpha: float = 8.0  # weight of the first round's information [1/nat]; see `round_alpha`
    starts: int = 5  # first guesses of Info-OCP: the straight line, and random ones
    objective: Objective = "eq8"  # of the first round
    # Of the rounds after it. Under eq. (9) they went where one thing could be learnt again and again, fast and far from
    # drifting. With updates they seek what is new, whether a drift asks for it or not.
    objective_later: Objective = "drifts"  # of later rounds
    ends_straight: bool = True  # informative plans do; without, they end in slides that leave the lane soon after
    bounded: bool = True  # speed, wheel spin and sideslip of plans
    checks: bool = True  # the steering, by a slow drive before
    steering: Steering = USUAL_STEERING  # of the car, as its check shows it
    fixed_alpha: bool = False  # the same weight of the information in later rounds
    # After informative drives, the lags of steering and torque are those of a bank that make the drives likeliest.
    learn_lags: bool = True  # of steering and torque, from informative drives
    tightening: float = 0.0
    """[-] Standard deviations of the predicted e by which a plan's lane is narrowed, by what is believed before
    the drive (`mpc.tightening`)."""
    path_step: PathStep = "trapezoid"  # Euler's would turn as the nominal car does: twice as far from the true car's
    only_converged: bool = False
    """A plan whose SQP has not converged is none. Without, one that is feasible is driven: with the shipped bounds its
    states are those of a car that can be caught, whether its cost is the least or not."""
    max_iterations: int = 80  # of the SQP
    tolerance: float = 1e-3  # [-] the SQP's, scaled: far below what the feedback absorbs
    qp: QpMethod = "stagewise"  # what solves the plans' quadratic programs
    # Inputs smoother than the drift controller's: that costs some information, but what is learnt carries over better
    # to drifting, and the true car stays nearer to the plan.
    weights: OcpWeights = dataclasses.field(default_factory=lambda: OcpWeights(delta=100.0, tau=3e-4))  # of the cost

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.tightening < np.inf:
            raise InvalidOptionError(f"tightening is {self.tightening:g}; give 0 or more")


def lane(config: GatheringConfig) -> Reference:
    """The lane, and the speed along it."""
    return straight_line(config.v_start, config.v_end, config.steps * DT, config.half_width)
