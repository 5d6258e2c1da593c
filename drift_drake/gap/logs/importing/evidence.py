"""What motion says of columns whose names or units leave a choice: ay = v r, r = d psi/dt, v = |d(x, y)/dt|."""

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import uniform_filter1d

from drift_drake.common.arrays import Array, correlation
from drift_drake.common.units import DIMENSIONS
from drift_drake.gap.logs.wording.conversion import QUANTITIES, dimension, factor

LIKE = 0.85  # correlation from which two signals are believed to be of one motion
EXACT = math.log(1.08)  # of a ratio to one, within which units fit
USUAL = {"v": ("m/s", "km/h", "mph", "kn"), "r": ("rad/s", "deg/s"), "ay": ("m/s^2", "g"), "psi": ("rad", "deg")}
BETTER = 0.15  # of a correlation, from which motion outweighs the order of names
AVERAGED = 0.3  # [s]
EARTH = 6.371e6  # [m] radius
LEAST = 30  # readings
TURNS, SURE = 24, 3.0  # parts of a recording that turns are compared in; standard deviations of unlike ones
MOVING = 0.2  # of the highest speed, below which a car has no direction
RADII, LARGE = (0.015, 0.6), 0.15  # [m] of wheels, from the smallest models on, and of cars that one sits in
FAST = 4.0  # [m/s]
WHEELBASES = (0.1, 8.0)  # [m] of vehicles; times the steering ratio, 10 to 20, of the steering wheel's angle
BEYOND = {"speed": 150.0, "angular rate": 50.0, "acceleration": 100.0}  # [SI] no vehicle's middle reading is
SAME_WAY = 0.1  # [rad] between the heading and the course of a car that does not slide
ROLLS = math.log(1.06)  # of a wheel's speed to the car's, over most of a drive


@dataclasses.dataclass(frozen=True)
class Trace:
    """Readings [n] of a column at times t [n] [s], in its own unit (None: it is not stated)."""

    t: Array
    values: Array
    unit: str | None

    def si(self) -> "Trace":
        size = factor(self.unit) if self.unit not in (None, "?") else 1.0
        return Trace(self.t, self.values * size, self.unit)


def is_raw(trace: Trace) -> bool:
    """Whether numbers cannot be in the unit that is stated: counts of a bus whose factor is not applied."""
    if trace.unit in (None, "?"):
        return False
    values = np.abs(trace.si().values)
    seen = values[np.isfinite(values)]
    return bool(len(seen)) and float(np.median(seen)) > BEYOND.get(dimension(trace.unit) or "", np.inf)


def likeness(a: Trace, b: Trace) -> float:
    """Correlation of two signals, zero where it is not known."""
    x, y = _paired(a, b)
    return correlation(x, y) if len(x) >= LEAST else 0.0


def better(quantity: str, choices: Sequence[Trace], known: Mapping[str, Trace]) -> int:
    """Which of several columns is that quantity by the motion: the first, unless another fits much better."""
    scores = [max((size for size, _ in agreements_with(quantity, c, known)), default=0.0) for c in choices]
    best = int(np.argmax(scores))
    return best if scores[best] > scores[0] + BETTER and scores[best] > LIKE else 0


def agreements_with(quantity: str, choice: Trace, known: Mapping[str, Trace]) -> list[tuple[float, str]]:
    """Correlations of a column that may be a quantity with what other columns say of it, each with what that is.

    Args:
        known: signals by quantity, in any unit and of either sign; the quantity itself is not asked.
    """
    found: list[tuple[float, str]] = []

    def add(one: Trace, other: Trace, says: str, less: float = 0.0) -> None:
        found.append((abs(likeness(one, other)) - less, says))

    if quantity == "r":
        if "psi" in known:
            add(choice, derivative(known["psi"], turns=True), "d psi/dt")
        if {"ay", "v"} <= set(known):
            add(product(choice, known["v"]), known["ay"], "ay / v")
    if quantity == "v" and {"ay", "r"} <= set(known):
        off = _off({"v": choice, "r": known["r"], "ay": known["ay"]})
        add(product(choice, known["r"]), known["ay"], "ay / r", min(off, 2.0 * BETTER))
    if quantity == "ay" and {"v", "r"} <= set(known):
        add(choice, product(known["v"], known["r"]), "v r")
    if quantity == "psi" and "r" in known:
        add(known["r"], derivative(choice, turns=True), "its rate is r")
    if quantity == "delta_cmd" and {"v", "r"} <= set(known):
        add(product(choice, known["v"]), known["r"], "r / v")
    if quantity == "omega_r" and "v" in known:
        add(choice, known["v"], "v")
    return found


def product(a: Trace, b: Trace) -> Trace:
    there = np.isfinite(b.values)
    if np.count_nonzero(there) < 2:
        return Trace(a.t, np.full(len(a.t), np.nan), None)
    return Trace(a.t, a.values * np.interp(a.t, b.t[there], b.values[there]), None)


def derivative(a: Trace, turns: bool = False) -> Trace:
    """Rate of change; of an angle that wraps (`turns`) too."""
    there = np.isfinite(a.values) & np.isfinite(a.t)
    t, values = a.t[there], a.values[there]
    fresh = np.diff(np.maximum.accumulate(t), prepend=-np.inf) > 0.0
    t, values = t[fresh], values[fresh]
    if len(t) < LEAST:
        return Trace(a.t[:0], a.t[:0], None)
    if turns:
        values = np.unwrap(values, period=360.0 if np.ptp(values) > 7.0 and a.unit is None else 2.0 * np.pi)
    return Trace(t, np.gradient(_averaged(t, values), t), None)


def velocity(north: Trace, east: Trace, degrees: bool) -> tuple[Trace, Trace]:
    """Velocity [m/s] to the north and east of a position [m], or of latitude and longitude [deg]."""
    along, across = derivative(north), derivative(east)
    if not len(along.t) or not len(across.t):  # too few readings
        return Trace(along.t[:0], along.t[:0], "m/s"), Trace(along.t[:0], along.t[:0], "m/s")
    size = math.radians(1.0) * EARTH if degrees else 1.0
    narrow = math.cos(math.radians(float(np.nanmean(north.values)))) if degrees else 1.0
    sideways = np.interp(along.t, across.t, across.values)
    return Trace(along.t, size * along.values, "m/s"), Trace(along.t, size * narrow * sideways, "m/s")


def travelled(north: Trace, east: Trace, degrees: bool) -> Trace:
    """Speed [m/s] of a position [m], or of latitude and longitude [deg]."""
    along, across = velocity(north, east, degrees)
    return Trace(along.t, np.hypot(along.values, across.values), "m/s")


def clockwise(north: Trace, east: Trace) -> Trace:
    """How fast the direction of a velocity turns clockwise [rad/s], where the car moves."""
    there = np.isfinite(east.values)
    if np.count_nonzero(there) < LEAST:
        return Trace(north.t[:0], north.t[:0], "rad/s")
    across = np.interp(north.t, east.t[there], east.values[there])
    speed = np.hypot(north.values, across)
    moving = speed > MOVING * np.nanmax(speed, initial=0.0)
    return derivative(Trace(north.t[moving], np.arctan2(across, north.values)[moving], "rad"), turns=True)


def sense(one: Trace, other: Trace) -> int:
    """Whether two rates turn the same way (1), against each other (-1), or it is not known (0)."""
    read = [(trace.t[there], trace.values[there]) for trace in (one, other)
            for there in [np.isfinite(trace.t) & np.isfinite(trace.values)]]  # fmt: skip
    if min(len(t) for t, _ in read) < LEAST:
        return 0
    start, end = max(t[0] for t, _ in read), min(t[-1] for t, _ in read)
    edges = np.linspace(start, end, 1 + max(TURNS, int(end - start)))
    a, b = (np.diff(np.interp(edges, t, cumulative_trapezoid(values, t, initial=0.0))) for t, values in read)
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    alike = float(a @ b) / size if end > start and size > 0.0 else 0.0
    return int(np.sign(alike)) if abs(alike) > max(0.5, SURE / math.sqrt(len(a))) else 0


def is_course(heading: Trace, t: Array, north: Array, east: Array) -> bool:
    """Whether a heading from north to the east is the direction in which a latitude and longitude [deg] move."""
    along, across = velocity(Trace(t, north, None), Trace(t, east, None), degrees=True)
    if not len(along.t):
        return False
    seen = np.isfinite(heading.values) & np.isfinite(heading.t)
    degrees = heading.unit == "deg" or (heading.unit is None and np.ptp(heading.values[seen]) > 7.0)
    angle = np.unwrap(np.radians(heading.values[seen]) if degrees else heading.values[seen])
    off = np.interp(along.t, heading.t[seen], angle) - np.arctan2(across.values, along.values)
    return bool(np.median(np.abs(np.angle(np.exp(1j * off)))) < SAME_WAY)


def units_by_motion(signals: Mapping[str, Trace], speed: Trace | None = None) -> dict[str, str]:
    """Units of v, r, ay, psi where none is stated and the motion tells it.

    Args:
        signals: by quantity; speed: of the position, where it is known.
    """
    found: dict[str, str] = {}
    if speed is not None and len(speed.t) and "v" in signals and signals["v"].unit is None:
        x, y = _paired(signals["v"], speed)
        moving = (x > 0.2 * np.max(x, initial=0.0)) & (y > 0.0)
        if np.count_nonzero(moving) >= LEAST:
            size = float(np.median(y[moving] / x[moving]))
            found.update(("v", unit) for unit in USUAL["v"] if abs(math.log(size / factor(unit))) < 0.5 * EXACT)
    if {"v", "r", "ay"} <= set(signals):
        given = {name: found.get(name, signals[name].unit) for name in ("v", "r", "ay")}
        found |= _turning(signals, given)
    rate = found.get("r", signals["r"].unit if "r" in signals else None)
    if (
        "psi" in signals
        and signals["psi"].unit is None
        and np.nanmax(np.abs(signals["psi"].values), initial=0.0) > 4.0 * np.pi
    ):
        found["psi"] = "deg"
    if rate is None and "r" in signals and "psi" in signals:
        heading = dataclasses.replace(signals["psi"], unit=found.get("psi", signals["psi"].unit)).si()
        found |= _rate(signals["r"], derivative(heading, turns=True))
    return found


def ratio(a: Trace, b: Trace) -> float:
    """The second signal in units of the first, over most of the time that both are not near zero; 0: not known."""
    x, y = _paired(a, b)
    moving = np.abs(x) > 0.2 * np.max(np.abs(x), initial=0.0)
    return float(np.median(y[moving] / x[moving])) if np.count_nonzero(moving) >= LEAST else 0.0


def wheel_unit(wheel: Trace, speed: Trace) -> str | None:
    """The unit of a wheel's speed by the car's [m/s]: of the rim, or of its turning about a wheel of sensible size."""
    size = ratio(wheel, speed)
    if size <= 0.0:
        return None
    rim = next((unit for unit in ("m/s", "km/h", "mph") if abs(math.log(size / factor(unit))) < ROLLS), None)
    if rim is not None:
        return rim
    fast = float(np.nanmedian(np.abs(speed.values))) > FAST
    radii = {unit: size / factor(unit) for unit in ("rad/s", "rpm")}
    likely = [unit for unit, radius in radii.items() if RADII[0] < radius < RADII[1] and (radius > LARGE or not fast)]
    return next(iter(likely), None)


def steering_unit(steer: Trace, speed: Trace, rate: Trace, handwheel: bool) -> str | None:
    """`deg` where a steering angle taken for radians belongs to no vehicle's wheelbase, and taken for degrees does."""
    length = abs(ratio(rate, product(steer, speed)))
    if abs(likeness(rate, product(steer, speed))) < LIKE:
        return None
    low, high = (10.0 * WHEELBASES[0], 20.0 * WHEELBASES[1]) if handwheel else WHEELBASES
    fast = float(np.nanmedian(np.abs(speed.values))) > FAST
    sensible = max(low, 1.0 if fast else 0.0) < math.radians(length) < high
    return "deg" if length > high and sensible else None


def _turning(signals: Mapping[str, Trace], given: Mapping[str, str | None]) -> dict[str, str]:
    """Units by which ay = v r, the fewest changed from SI."""
    if None not in given.values() or "?" in given.values():
        return {}
    fits = [(off + changed, units) for off, changed, units in _explained(signals, given) if off < EXACT]
    if not fits:
        return {}
    _, units = min(fits, key=lambda fit: fit[0])
    return {name: unit for name, unit in units.items() if given[name] is None}


def _off(signals: Mapping[str, Trace]) -> float:
    """How far (logarithm) v, r and ay are from ay = v r in the units that explain them best; 0: not known."""
    given = {name: None if signal.unit == "?" else signal.unit for name, signal in signals.items()}
    return min((off for off, _, _ in _explained(signals, given)), default=0.0)


def _explained(
    signals: Mapping[str, Trace], given: Mapping[str, str | None]
) -> list[tuple[float, int, dict[str, str]]]:
    """How far off ay = v r is, and how many units differ from SI, for all usual units of what states none."""
    x, y = _paired(product(signals["r"], signals["v"]), signals["ay"])
    if len(x) < LEAST or abs(correlation(x, y)) < LIKE:
        return []
    size = float(np.std(x) / np.std(y))
    found = []
    for choice in itertools.product(*(USUAL[name] if unit is None else (unit,) for name, unit in given.items())):
        units = dict(zip(given, choice, strict=True))
        off = abs(math.log(size * factor(units["v"]) * factor(units["r"]) / factor(units["ay"])))
        changed = sum(units[name] != DIMENSIONS[QUANTITIES[name]][0] for name in given if given[name] is None)
        found.append((off, changed, units))
    return found


def _rate(r: Trace, heading_rate: Trace) -> dict[str, str]:
    x, y = _paired(r, heading_rate)
    if len(x) < LEAST or abs(correlation(x, y)) < LIKE:
        return {}
    size = float(np.std(y) / np.std(x))
    unit = next((unit for unit in USUAL["r"] if abs(math.log(size / factor(unit))) < 3.0 * EXACT), None)
    return {} if unit is None else {"r": unit}


def _paired(a: Trace, b: Trace) -> tuple[Array, Array]:
    """The second signal at the first one's times, both averaged, where both are there."""
    there, other = np.isfinite(a.values) & np.isfinite(a.t), np.isfinite(b.values) & np.isfinite(b.t)
    if np.count_nonzero(there) < LEAST or np.count_nonzero(other) < LEAST:
        return np.empty(0), np.empty(0)
    t, tb = a.t[there], b.t[other]
    inside = (t >= tb[0]) & (t <= tb[-1])
    if np.count_nonzero(inside) < LEAST:
        return np.empty(0), np.empty(0)
    mean = _averaged(tb, b.values[other])
    return _averaged(t, a.values[there])[inside], np.interp(t[inside], tb, mean)


def _averaged(t: Array, values: Array) -> Array:
    step = (t[-1] - t[0]) / max(1, len(t) - 1)
    width = int(np.clip(round(AVERAGED / step), 1, max(1, len(values) // 5))) if step > 0.0 else 1
    return np.asarray(uniform_filter1d(values, width, mode="nearest"))
