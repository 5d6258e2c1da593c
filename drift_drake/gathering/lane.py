"""A short drive along a lane as an optimal control problem: what informative drives are planned on."""

import dataclasses

import numpy as np

from drift_drake.arrays import Array
from drift_drake.control.ocp import OcpData, OptimalControlProblem, described
from drift_drake.control.plan import DT
from drift_drake.errors import InvalidOptionError
from drift_drake.vehicle.step_model import STATE_SCALE

SLOWEST, FASTEST = 1.0, 60.0  # [m/s] of a plan's ends
WIDEST = 50.0  # [m] of a lane to either side
FEASIBLE = 1e-2  # largest gap in a plan's dynamics, in scaled variables (0.1 m/s, 0.005 rad), that the feedback absorbs
SIDESLIP_SOFTENING = 0.3  # [rad] over the limit that cost as much as 1 m over the lane's edge
SLIP_SOFTENING = 5.0  # [m/s], likewise
# How an informative plan ends, as weights of the states and a limit to either side: yaw rate [rad/s], sideslip and
# course [rad], and the rear rim's slip over the ground [m/s].
ENDS = (({0: 1.0}, 0.2), ({2: 1.0}, 0.05), ({5: 1.0}, 0.1), ({3: 1.0, 1: -1.0}, 2.0))
END_SOFTENING = 0.3  # of a limit that costs as much as 1 m over the lane's edge


@dataclasses.dataclass(frozen=True)
class LaneDrive:
    """The paper's section IV-A: from 7.5 to 20 m/s along a straight line in 4.5 s."""

    steps: int = 45
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
    """The lane's middle, or a line e(t) [N+1] [m] beside it, as an OCP's data: the car enters it from a straight.

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
    n, x = config.steps, problem.x[1:]
    eye, unbounded = np.eye(n), np.full(n, np.inf)
    beta, rim, speed = STATE_SCALE[2] * eye, STATE_SCALE[3] * eye, STATE_SCALE[1] * eye
    for what, states, quantity, limit, softening, signs in (
        ("sideslip", x[:, [2]], [beta], config.max_sideslip, SIDESLIP_SOFTENING, (1.0, -1.0)),
        ("wheel spin", x[:, [3, 1]], [rim, -speed], config.max_slip, SLIP_SOFTENING, (1.0, -1.0)),
        ("least speed", x[:, [1]], [speed], -config.min_speed, SLIP_SOFTENING, (-1.0,)),
    ):
        for sign in signs:
            row = np.concatenate([*(sign * block for block in quantity), -softening * eye], axis=1)
            variables = np.concatenate([states.ravel(order="F"), problem.slack])
            bound = problem.AddLinearConstraint(row, -unbounded, np.full(n, limit), variables)
            described(f"{what}, softened", bound)


def bound_end(problem: OptimalControlProblem, curvature: float = 0.0) -> None:
    """Bounds how the drive ends, so that a car which drives on can be kept in the lane.

    Softened as `bound_slip` is. On a lane of a curvature [1/m] the yaw rate beyond the lane's is bounded.
    """
    end, slack = problem.x[-1], problem.slack[-1:]
    (_, yaw), *others = ENDS
    for weights, limit in (({0: 1.0, 1: -curvature} if curvature else {0: 1.0}, yaw), *others):
        row = np.array([weight * STATE_SCALE[state] for state, weight in weights.items()])
        rows = np.column_stack([np.stack([row, -row]), np.full(2, -END_SOFTENING * limit)])
        states = np.append(end[list(weights)], slack)
        bound = problem.AddLinearConstraint(rows, np.full(2, -np.inf), np.full(2, limit), states)
        described("straight at the end, softened", bound)
