"""What a drive that is planned for information is: along which lane, by which objective, within which limits."""

import dataclasses
from typing import Literal

import numpy as np

from drift_drake.car.step_model import STATE_SCALE
from drift_drake.common.arrays import Array
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.learnt.bayesian_step import PathStep
from drift_drake.drive.mpc.ocp import OcpData, OcpWeights, OptimalControlProblem
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.qp.qp import QpMethod
from drift_drake.drive.qp.stages import StageRows
from drift_drake.drive.reference.stadium import HARDEST, Stadium, stadium
from drift_drake.drive.reference.trajectory import Reference, circle

SLOWEST, FASTEST = 1.0, 60.0  # [m/s] of a plan's ends
WIDEST = 50.0  # [m] of a lane to either side
FEASIBLE = 1e-2  # largest gap in a plan's dynamics, in scaled variables (0.1 m/s, 0.005 rad), that the feedback absorbs
SIDESLIP_SOFTENING = 0.3  # [rad] over the limit that cost as much as 1 m over the lane's edge
SLIP_SOFTENING = 5.0  # [m/s], likewise
# How an informative plan ends, as weights of the states and a limit to either side: yaw rate [rad/s], sideslip and
# course [rad], and the rear rim's slip over the ground [m/s].
ENDS = (({0: 1.0}, 0.2), ({2: 1.0}, 0.05), ({5: 1.0}, 0.1), ({3: 1.0, 1: -1.0}, 2.0))
END_SOFTENING = 0.3  # of a limit that costs as much as 1 m over the lane's edge
# What a plan is to tell: l_info of eq. (9); the same with the covariance updated along the horizon; of drifts to come.
Objective = Literal["eq8", "updated", "drifts"]
NARROWEST = 0.5  # half width of a lane that bends, of its radius
LONGEST_DRIVE = 600.0  # [s] on a track


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


def problem_data(config: LaneDrive, lateral: Array | None = None, curvature: float = 0.0) -> OcpData:
    """The lane's middle, or a line e(t) [N+1] [m] off it, as an OCP's data: the car enters it from a straight.

    Args:
        curvature: of the lane [1/m], positive to the left.
    """
    n = config.steps
    reference = np.zeros((n + 1, 6))
    reference[:, 1] = reference[:, 3] = np.linspace(config.v_start, config.v_end, n + 1)
    reference[:, 0] = curvature * reference[:, 1]
    if lateral is not None:
        reference[:, 4] = lateral
        reference[:, 5] = np.gradient(lateral, DT) / reference[:, 1]
    lane = np.full(n + 1, config.half_width - config.margin)
    start = np.array([0.0, config.v_start, 0.0, config.v_start, 0.0, 0.0])
    return OcpData(start, np.zeros(2), reference, np.full(n, curvature), -lane, lane)


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


def bound_end(problem: OptimalControlProblem, curvature: float = 0.0) -> None:
    """Bounds how the drive ends, so that a car which drives on can be kept in the lane.

    Softened as `bound_slip` is. On a lane of a curvature [1/m] the yaw rate beyond the lane's is bounded.
    """
    last = np.full(2, problem.horizon)
    (_, yaw), *others = ENDS
    for weights, limit in (({0: 1.0, 1: -curvature} if curvature else {0: 1.0}, yaw), *others):
        rows = np.array([softened(problem, weights, sign, END_SOFTENING * limit) for sign in (1.0, -1.0)])
        problem.bound(StageRows("straight at the end, softened", last, rows, np.full(2, -np.inf), np.full(2, limit)))


@dataclasses.dataclass(frozen=True)
class GatheringConfig(LaneDrive):
    """A lane drive that is worth learning from (section IV-A of the paper), its plans and the rounds.

    Raises:
        InvalidOptionError: a number out of its range; it names the option and the range.

    Examples:
        >>> GatheringConfig(steps=30).half_width
        3.0
    """

    curvature: float = 0.0
    """[1/m] of the lane, which is a circle then; positive to the left."""
    lane: Literal["open", "track"] = "open"
    """A track is closed, and driven for longer than a plan: it is planned again each `replan` [s], as far ahead as at
    the start. Its speed is the track's, up to `v_end`."""
    track: Stadium = dataclasses.field(default_factory=Stadium)  # of `lane` "track"
    duration: float = 9.0  # [s] of a drive on the track

    # Bolder than where only a nominal car plans: on validation vehicles, drives up to here taught most about drifting.
    max_sideslip: float = 0.35  # [rad] in plans
    alpha: float = 8.0  # weight of the first round's information [1/nat]; see `round_alpha`
    starts: int = 5  # first guesses of Info-OCP: the straight line, and random ones
    objective: Objective = "eq8"  # of the first round
    # Of the rounds after it. Under eq. (9) they went where one thing could be learnt again and again, fast and far from
    # drifting. With updates they seek what is new, whether a drift asks for it or not.
    objective_later: Objective = "drifts"  # of later rounds
    ends_straight: bool = True  # informative plans do; without, they end in slides that leave the lane soon after
    replan: float = 0.0  # [s], in whole steps, after which the rest of a drive is planned again with what it has taught
    stop_below: float = 0.0
    """[-] A replanned drive ends where what it still promises is less than this share of what it taught; 0: never."""
    bounded: bool = True  # speed, wheel spin and sideslip of plans
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
        if self.lane == "track":
            self._check_track()
        lateral, half_width = abs(self.curvature) * self.v_end**2, self.half_width
        if not lateral <= HARDEST:
            raise InvalidOptionError(
                f"a curvature of {self.curvature:g} 1/m at a v_end of {self.v_end:g} m/s asks for {lateral:.1f} m/s^2; "
                f"give less of either, for {HARDEST:g} at most"
            )
        if not abs(self.curvature) * half_width <= NARROWEST:
            raise InvalidOptionError(
                f"a lane of {half_width:g} m to either side cannot have a curvature of {self.curvature:g} 1/m; give "
                f"{NARROWEST / half_width:g} at most"
            )
        if self.replan != 0.0 and not self.replan >= DT:
            raise InvalidOptionError(f"replan is {self.replan:g} s; give {DT:g} s or more, or 0 for never")
        if not 0.0 <= self.tightening < np.inf or (self.tightening > 0.0 and self.replan > 0.0):
            raise InvalidOptionError(f"tightening is {self.tightening:g}; give 0 or more, and above 0 no replan")
        if not 0.0 <= self.stop_below <= 1.0:
            raise InvalidOptionError(f"stop_below is {self.stop_below:g}; give 0 to 1")

    def _check_track(self) -> None:
        if self.curvature != 0.0:
            raise InvalidOptionError(f"a track has bends of its own; leave out the curvature of {self.curvature:g} 1/m")
        if not self.half_width <= NARROWEST * self.track.radius:
            raise InvalidOptionError(
                f"a lane of {self.half_width:g} m to either side cannot have a radius of {self.track.radius:g} m; give "
                f"{self.half_width / NARROWEST:g} or more"
            )
        if not DT <= self.duration <= LONGEST_DRIVE:
            raise InvalidOptionError(f"duration is {self.duration:g} s; give {DT:g} to {LONGEST_DRIVE:g}")
        if not 0.0 < self.replan <= self.steps * DT:
            raise InvalidOptionError(
                f"a track is driven for longer than a plan; give replan up to {self.steps * DT:g} s, such as 0.5"
            )

    @property
    def drive_time(self) -> float:
        """How long a drive takes [s]: a plan, but on the track."""
        return self.duration if self.lane == "track" else self.steps * DT


def lane(config: GatheringConfig) -> Reference:
    """The lane, and the speed along it."""
    if config.lane == "track":
        return stadium(config.track, config.v_end, config.half_width)
    return circle(config.v_start, config.v_end, config.steps * DT, config.curvature, config.half_width)


def positions(config: GatheringConfig, states: Array, start: float = 0.0) -> Array:
    """Path positions [N+1] [m] at planned states (r, v, beta, omega_r, e, dphi, ...) [N+1, 6 or more].

    Args:
        start: of the first one [m].
    """
    path, e = lane(config).path, states[:, 4]
    forward = states[:, 1] * np.cos(states[:, 5])
    out = np.full(len(states), start)
    for k in range(len(states) - 1):
        bend = float(path.curvature(float(out[k] + 0.5 * DT * forward[k])))
        out[k + 1] = out[k] + 0.5 * DT * (forward[k] + forward[k + 1]) / (1.0 - bend * 0.5 * (e[k] + e[k + 1]))
    return out


def curvature_along(config: GatheringConfig, states: Array, start: float = 0.0) -> Array:
    """The lane's mean curvature [N] [1/m] over the steps between planned states; see `positions`."""
    if config.lane == "open":
        return np.full(len(states) - 1, config.curvature)
    return _mean_curvature(lane(config), positions(config, states, start))


def lane_data(config: GatheringConfig, lateral: Array | None = None, s: Array | None = None) -> OcpData:
    """The OCP's data along the lane, from its beginning.

    Args:
        lateral: a line e(t) [N+1] [m] off the middle of an open lane to follow, see `problem_data`.
        s: path positions [N+1] [m] on a track where a plan is expected; without, those of the reference.
    """
    if config.lane == "open":
        return problem_data(config, lateral, config.curvature)
    course = lane(config)
    s = course.horizon(0.0, DT, config.steps).s if s is None else s
    states, edge = course.state(s), np.full(len(s), config.half_width - config.margin)
    return OcpData(states[0], np.zeros(2), states, _mean_curvature(course, s), -edge, edge)


def _mean_curvature(course: Reference, s: Array) -> Array:
    return np.asarray(np.diff(course.path.heading(s)) / np.diff(s), dtype=np.float64)
