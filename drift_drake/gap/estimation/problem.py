"""The runs of one case as measurements for the filter, and the car that a hypothesis' parameters are of.

A parameter vector theta holds the nuisances first: the tolerances of the vehicle, in units of their standard
deviation; then what the two commands were before each run's first row, relative to that row, in units of
`START_STEERING` and `START_TORQUE`, where an effect with states behind the commands makes them matter. Then come the
magnitudes of a hypothesis' effects, in the units of the catalogue.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.actuated import actuated
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects, combined
from drift_drake.car.parameters import RELATIVE, Constants, VehicleParameters
from drift_drake.gap.estimation.prior import bounds, scale
from drift_drake.gap.estimation.run_data import RunData

NUISANCES = (
    "mass",
    "yaw_inertia",
    "front_axle_distance",
    "wheel_radius",
    "rear_axle_inertia",
    "torque",
    "friction",
    "front_stiffness",
    "rear_stiffness",
    "steering_offset",
    "wheel_speed_scale",  # the rim speed is logged with the radius that the vehicle file states
    "limiter_settling",  # how sharply a rate limiter lets go: no two actuators or simulators agree on it
)
TOLERANCES = len(NUISANCES) - 1  # nuisances that are deviations of the vehicle
NUISANCE_STEP = 0.05  # of a tolerance, for differences
LIMITER_SETTLING = 0.004  # [s] time constant of a rate-limited wheel that can follow
LIMITER_DEVIATION = 0.7  # of its logarithm

START_STEERING, START_TORQUE = 0.03, 0.06  # [rad], [of the torque's range] that commands may jump by at the first row
START_MATTERS = tuple(  # effects under which the commands before the first row act on the car
    frozenset(name for name, info in CATALOGUE.items() if command in (*info.remembers, info.delays))
    for command in ("delta_cmd", "tau_cmd")
)
LATE_START = 0.2  # [s] that a filter of late sensors waits: the first rows may be held, not measured
# Late sensors are an early clock of the commands as well.
WAITED_FOR = frozenset(name for name, info in CATALOGUE.items() if info.late or info.hastens)
# Process noise of a car that is modelled well: standard deviation per root second of each filter state.
PROCESS_NOISE = np.array([9e-4, 3e-3, 4.5e-4, 9e-3, 3e-5, 3e-4, 3e-4, 3e-4, 3e-4])
FED_INERTIA = 1e9  # factor on the rear axle's inertia then: no torque turns it, the measurement alone

Commands = tuple[np.ndarray, np.ndarray]  # steering [rad] and torque [N m] on the stages' grid


@dataclasses.dataclass(frozen=True)
class ModelDiscrepancy:
    """The model discrepancy of a calibrated car, as `identify` learns it (`freeform.applied`)."""

    forces: Mapping[str, Sequence[float]]  # by channel, weights of `freeform.state_functions` in `freeform.FORCE_UNIT`
    offsets: Mapping[str, float]  # of sensors, in noise levels
    tempering: float  # likelihood tempering exponent with them


@dataclasses.dataclass(frozen=True)
class Filtered:
    """What judges parameters: the innovations [rows, 9] of all runs and the log determinant that goes with them."""

    innovations: list[np.ndarray]
    logdet: float  # times the tempering exponent


@dataclasses.dataclass(frozen=True)
class Gains:
    """Frozen gains and whitening matrices [rows, 9, 9] of all runs, and what the filter found with them."""

    gain: list[np.ndarray]
    whitening: list[np.ndarray]
    filtered: Filtered

    @property
    def innovations(self) -> list[np.ndarray]:
        """Of all runs [rows, 9]."""
        return self.filtered.innovations


@dataclasses.dataclass(frozen=True)
class Problem:
    """What a case gives the estimator."""

    runs: list[RunData]
    vehicle: VehicleParameters
    nominal: Constants
    tolerance: np.ndarray  # standard deviations of NUISANCES
    noise: np.ndarray  # [9] standard deviations of the channels
    process: np.ndarray  # [9] variances a second of the first nine filter states
    rim_fed: bool = False  # no torque is logged: the rim speed is fed as measured, and the axle's dynamics are left out
    exactness: float = 1.0  # the vehicle's deviations are believed to be this small, in tolerances
    own: Effects = dataclasses.field(default_factory=Effects)  # that the vehicle file has; a hypothesis adds to them
    ranges: Mapping[str, tuple[float, float]] = dataclasses.field(default_factory=dict)  # in place of `prior.bounds`
    discrepancy: ModelDiscrepancy | None = None  # whose trace the runs hold
    step: float = NUISANCE_STEP  # for differences
    tempering: float = 1.0  # power that the likelihood of the logs is raised to; the priors count in full

    def replace(self, **changes: object) -> "Problem":
        return dataclasses.replace(self, **changes)  # type: ignore[arg-type]

    def range_of(self, name: str) -> tuple[float, float]:
        """Magnitudes of an effect that are believed possible."""
        return self.ranges.get(name) or bounds(name, self.vehicle)

    def unit_of(self, name: str) -> float:
        """Unit of a magnitude in the solver: the far end of its practical range."""
        return max(abs(q) for q in self.ranges[name]) if name in self.ranges else scale(name, self.vehicle)

    @property
    def nuisances(self) -> int:
        """Parameters ahead of the magnitudes."""
        return len(NUISANCES) + 2 * len(self.runs)

    @property
    def count(self) -> int:
        """Measurements that count."""
        return int(sum(np.sum(run.counted) * np.sum(run.used) for run in self.runs))


def tolerance_deviations(vehicle: VehicleParameters) -> np.ndarray:
    """Standard deviations of NUISANCES."""
    stated = dataclasses.asdict(vehicle.tolerance)
    return np.array([stated[name] for name in NUISANCES[:-2]] + [stated["wheel_radius"], LIMITER_DEVIATION])


def car(problem: Problem, theta: np.ndarray, names: Sequence[str]) -> tuple[Constants, Effects]:
    """Constants and effects of a parameter vector under a hypothesis' effects."""
    n = dict(zip(NUISANCES, (float(d) for d in theta[: len(NUISANCES)] * problem.tolerance), strict=True))
    p = problem.nominal
    changes = {name: getattr(p, name) * (1.0 + n[name]) for name in RELATIVE}
    changes["rear_axle_inertia"] *= FED_INERTIA if problem.rim_fed else 1.0
    constants = p._replace(
        **changes,
        front_axle_distance=p.front_axle_distance + n["front_axle_distance"],
        rear_axle_distance=p.rear_axle_distance - n["front_axle_distance"],
        gear_ratio=p.gear_ratio * (1.0 + n["torque"]),
    )
    magnitudes = dict(zip(names, (float(q) for q in theta[problem.nuisances :]), strict=True))
    magnitudes["steering_offset"] = magnitudes.get("steering_offset", 0.0) + n["steering_offset"]
    wheel = magnitudes.get("wheel_radius_error", 0.0)
    magnitudes["wheel_radius_error"] = (1.0 + wheel) * (1.0 + n["wheel_speed_scale"]) - 1.0
    if "steering_rate_limit" in magnitudes and "steering_lag" not in magnitudes:
        magnitudes["steering_lag"] = LIMITER_SETTLING * float(np.exp(n["limiter_settling"]))
    effects = Effects(**magnitudes)
    return constants, combined(problem.own, effects) if any(problem.own) else effects


def first_row(run: RunData, names: Sequence[str]) -> int:
    """Row that the filter starts from."""
    return round(LATE_START / run.period) if WAITED_FOR.intersection(names) else 0


def run_commands(problem: Problem, index: int, theta: np.ndarray, effects: Effects) -> Commands:
    """What a run's commands become before they reach the car (`filter_state.actuated`)."""
    run, vehicle = problem.runs[index], problem.vehicle
    at = len(NUISANCES) + 2 * index
    before = (
        float(run.delta[0] + START_STEERING * theta[at]),
        float(run.tau[0] + START_TORQUE * (vehicle.torque_max - vehicle.torque_min) * theta[at + 1]),
    )
    return actuated(run.delta, run.tau, before, run.period, effects)


def flat(problem: Problem, innovations: Sequence[np.ndarray]) -> np.ndarray:
    """Innovations that count, of all runs in a row [count], such that half their squares are weighted nats."""
    return np.concatenate([counted(problem, run, e).ravel() for run, e in zip(problem.runs, innovations, strict=True)])


def counted(problem: Problem, run: RunData, innovations: np.ndarray) -> np.ndarray:
    """Rows and channels of one run's innovations [rows, 9, ...] that count, times the exponent's root."""
    return np.asarray(np.sqrt(problem.tempering) * innovations[run.counted][:, run.used])
