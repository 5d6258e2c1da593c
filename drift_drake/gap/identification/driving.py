"""What the drives of a baseline can show of a car, before anything is fitted to them, and which drive is missing.

Friction shows where a tyre is near its limit, a steering offset where the car turns to both sides, lags where the
steering moves fast. Parameters that drives cannot show stay at their first guess (`identification.stated`): a fit moves
them to make up for something else.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.windows import smoothed

SUSTAINED = 0.5  # [s] in all, for which something must be reached to count
SEEN = 0.5  # of the friction limit, from which a tyre's curve bends enough for friction to be estimated
GENTLE = 0.15  # below which tyres cannot be distinguished from the sensors' biases either
TURNING = 0.1  # of the friction limit, below which no side is turned to
OTHER_SIDE = 1 / 3  # of what is reached on the harder side, below which a baseline is one-sided
LIVELY = 1.0  # [1/s] friction limits that the lateral acceleration changes by
THROTTLE = 0.05  # of the friction limit, that both full throttle and lift-off or braking reach
SHORT = 20.0  # [s]
CALM = 0.2  # [s] of the measurements' smoothing: rates of noise are no driving
TYRES = ("friction", "front_stiffness", "rear_stiffness", "front_axle_distance", "yaw_inertia", "mass")
CIRCLES = "circles to the left and to the right at several speeds, slowly tightened until the car slides"
SLIPPERY = "on a slippery road, a first guess of the friction near what the tyres reach there will do"
ONE_RECORDING = "there is one recording"
SWEEPS = "steps and fast sine sweeps of the steering (up to 2 Hz) at constant speed, well within grip"
STEPS = "full throttle, part throttle and lift-off or braking, in steps, straight on and in a turn"


@dataclasses.dataclass(frozen=True)
class Missing:
    """A drive that a baseline lacks."""

    why: str  # a clause
    leaves: tuple[str, ...]  # parameters and effects that it would show
    drive: str
    grave: bool  # a calibration without it is not good enough

    def sentence(self) -> str:
        """What is missing and what to drive, in words."""
        return f"{self.why}, which leaves open: {', '.join(self.leaves)}; drive {self.drive}"


@dataclasses.dataclass(frozen=True)
class Driving:
    """How the car was driven, each for half a second or more in all; accelerations are shares of the friction limit."""

    seconds: float
    recordings: int
    used: float  # share of the friction limit, by the first guess's friction
    left: float  # of lateral acceleration to the left
    right: float
    accelerating: float
    braking: float
    lively: float  # [1/s] change of the lateral acceleration
    torque: bool  # is logged

    @property
    def gentle(self) -> bool:
        """Whether not even the tyres' stiffness can be identified."""
        return self.used < GENTLE

    @property
    def shows_friction(self) -> bool:
        """Whether a tyre came near its limit."""
        return self.used >= SEEN

    @property
    def one_sided(self) -> bool:
        """Whether the car turned to one side alone, or far harder than to the other."""
        softer, harder = sorted((self.left, self.right))
        return harder >= TURNING and softer < OTHER_SIDE * harder

    @property
    def unseen(self) -> tuple[str, ...]:
        """Parameters (names of tolerances) that these drives cannot show."""
        grip = TYRES if self.gentle else () if self.shows_friction else ("friction",)
        return (*grip, "steering_offset") if self.one_sided else grip

    def shows_friction_of(self, first_guess: float, fitted: float) -> bool:
        """Whether that is still so, once the car's friction has turned out to be another one."""
        return self.used * first_guess >= SEEN * fitted

    def too_gentle(self, case: str) -> str:
        """Why nothing is calibrated on such drives, and what to do."""
        return (
            f"{case}: too gentle to calibrate a car on: {100.0 * self.used:.0f} % of the friction limit is used, "
            f"{100.0 * GENTLE:.0f} % are the least (from {100.0 * SEEN:.0f} % on friction shows too); drive {CIRCLES}, "
            "or take what is calibrated here for a guess and give --force, which leaves the tyres as they are"
        )

    def missing(self) -> list[Missing]:
        """Drives that the baseline lacks, the gravest first."""
        out = []
        if not self.shows_friction:
            why = (
                f"at most {100.0 * self.used:.0f} % of the friction limit is used ({100.0 * SEEN:.0f} % would show it)"
            )
            out.append(Missing(why, TYRES if self.gentle else TYRES[:1], CIRCLES, True))
        if self.one_sided:
            harder, softer = ("left", "right") if self.left > self.right else ("right", "left")
            most, other = max(self.left, self.right), min(self.left, self.right)
            why = (
                f"turns to the {harder} reach {100.0 * most:.0f} % of the friction limit, those to the {softer} "
                f"{100.0 * other:.0f} %"
            )
            leaves = ("steering_offset", "the sensors' biases")
            out.append(Missing(why, leaves, f"the same turns to the {softer}", True))
        if self.seconds < SHORT:
            why = f"{self.seconds:.3g} s of driving can be used ({SHORT:g} s are the least)"
            out.append(Missing(why, ("most parameters",), "each kind of driving for 10 s or more", True))
        if self.recordings == 1:
            why = ONE_RECORDING
            differs = ("how the car differs from one recording to the next",)
            out.append(Missing(why, differs, "the same again, in a recording of its own", True))
        if self.lively < LIVELY:
            why = f"lateral acceleration changes by {self.lively:.2g} friction limits a second ({LIVELY:g} would do)"
            out.append(Missing(why, ("yaw_inertia", "steering_lag", "tyre_relaxation"), SWEEPS, False))
        if self.torque and min(self.accelerating, self.braking) < THROTTLE:
            least = min(self.accelerating, self.braking)
            what = "acceleration" if self.accelerating == least else "deceleration"
            why = f"{what} reaches {100.0 * least:.0f} % of the friction limit ({100.0 * THROTTLE:.0f} % would do)"
            out.append(Missing(why, ("gear_ratio (torque)", "rear_axle_inertia", "torque_lag"), STEPS, False))
        return sorted(out, key=lambda one: not one.grave)


def driving_of(runs: Sequence[Run], vehicle: VehicleParameters) -> Driving:
    """How hard and how variedly a car was driven, by its first guess.

    Args:
        runs: parts that can be used (`gap.estimation.usable`).
    """
    limit = vehicle.friction * vehicle.gravity
    seconds, lateral, forward, change = (list[np.ndarray]() for _ in range(4))
    for run in runs:
        v, r = (smoothed(values, run.period, CALM) for values in (run.v, run.r))
        seconds.append(np.full(len(run), run.period))
        lateral.append(v * r / limit)
        forward.append(np.gradient(np.abs(v), run.period) / limit)
        change.append(np.abs(np.gradient(lateral[-1], run.period)))
    dt, side, along = np.concatenate(seconds), np.concatenate(lateral), np.concatenate(forward)
    torque = all(run.tau_cmd is not None for run in runs)  # else speeds are fed, and friction shows in turns alone
    return Driving(
        seconds=float(dt.sum()), recordings=len({run.recording or run.name for run in runs}),
        used=reached(np.hypot(side, along if torque else 0.0), dt), left=reached(side, dt), right=reached(-side, dt),
        accelerating=reached(along, dt), braking=reached(-along, dt), lively=reached(np.concatenate(change), dt),
        torque=torque,
    )  # fmt: skip


def reached(values: np.ndarray, seconds: np.ndarray) -> float:
    """What values [rows] are at or above for `SUSTAINED` seconds in all, zero at least; seconds: of each row [rows]."""
    order = np.argsort(-values)
    at = int(np.searchsorted(np.cumsum(seconds[order]), SUSTAINED - 1e-9))
    return max(float(values[order[min(at, len(order) - 1)]]), 0.0)
