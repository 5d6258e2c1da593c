"""What is worth keeping of a recording: stretches in motion without gaps, each with the vehicle's motion."""

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from drift_drake.car.log.driving import in_spans, spans
from drift_drake.common.arrays import Array
from drift_drake.gap.logs.importing.known import needs_path
from drift_drake.gap.logs.importing.mapping import DERIVABLE, RecorderMapping
from drift_drake.gap.logs.importing.position import path_motion
from drift_drake.gap.logs.importing.recording import Readings
from drift_drake.gap.logs.importing.smoothing import SHORTEST, noise_of, smooth
from drift_drake.gap.logs.noise import without_jumps
from drift_drake.gap.logs.screening.bad_samples import stuck
from drift_drake.gap.logs.wording.conversion import PlanarMotion, at_centre_of_gravity, to_body

LARGEST_GAP = 0.2  # [s] without readings that is bridged; a longer one ends the stretch
SPEED_WINDOW = 0.1  # [s] over which a first, rough speed is taken
STOP = 0.1  # [s]; a shorter time below the speed of `moving` is no stop
BACKWARDS = 0.5  # [m/s] of backward velocity that noise explains in any log
SURE, LONGEST_MEAN = 4.0, 1.0  # standard deviations of a velocity's noise that are none; [s] that it is averaged over
SHOWN = 3  # places in a sentence
STANDING = 2.0  # [m/s] at the change of direction: a car that reverses has stopped before, one that spins has not
SHORTEST_REVERSING = 0.1  # [s]
VELOCITY = {"vx", "vy", "r"}  # what speed and sideslip at the centre of gravity are made of
MEASURED = ("r", "v", "vx", "vy", "beta", "omega_r", "ax", "ay")  # whose noise is worth an estimate


@dataclasses.dataclass(frozen=True)
class Stretch:
    """All signals of the log's clock, and what is derived from them, at times t [n] [s]; at the centre of gravity.

    `noise`: standard deviation of one reading (SI), by signal; `std`: the columns' typical ones after smoothing;
    `bandwidth` [Hz]: of the smoothers, up to which position and heading are taken for motion.
    """

    t: Array
    columns: dict[str, Array]
    noise: dict[str, float]
    std: dict[str, float]
    bandwidth: dict[str, float]


def moving_stretches(readings: Readings, mapping: RecorderMapping) -> list[slice]:
    """Ticks of the log's clock between stops and gaps; all of them where the mapping asks for no motion."""
    t = readings.t
    seen = np.flatnonzero(np.all([np.isfinite(values) for values in readings.signals.values()], axis=0))
    if len(seen) < SHORTEST:
        return []
    keep = np.zeros(len(t), dtype=bool)
    speed = _rough_speed(readings, seen)
    moving = mapping.moving
    if moving is None or speed is None:
        keep[seen[0] : seen[-1] + 1] = True
    else:
        keep[seen[0] : seen[-1] + 1] = (speed > moving.speed)[seen[0] : seen[-1] + 1]
        for start, stop in spans(~keep):
            if start > 0 and stop < len(t) and t[stop] - t[start] < STOP:
                keep[start:stop] = True
    for before, after in itertools.pairwise(seen):
        if t[after] - t[before] > LARGEST_GAP:
            keep[before + 1 : after] = False
            keep[before] = False
    shortest = 0.0 if moving is None else moving.shortest
    return [slice(a, b) for a, b in spans(keep) if b - a >= SHORTEST and t[b - 1] - t[a] >= shortest]


def stretch_of(readings: Readings, part: slice, mapping: RecorderMapping) -> Stretch:
    """The motion over one stretch of the log's clock."""
    t = readings.t[part]
    signals = {name: values[part] for name, values in readings.signals.items()}
    columns = {name: _filled(t, values) for name, values in signals.items()}
    noise, std, bandwidth = {}, {}, {}
    for name in MEASURED:
        if name in signals:
            noise[name] = std[name] = noise_of(t, without_jumps(signals[name]))
    if {"x", "y", "psi"} <= set(signals):
        captured = captured_motion(
            t, signals["x"], signals["y"], signals["psi"], mapping.measured_point, mapping.bandwidth
        )
        given = set(signals) | ({"v", "beta"} if {"vx", "vy"} <= set(mapping.signals) else set())
        wanted = {"x", "y", "psi"} | {name for name in mapping.derive if name in DERIVABLE and name not in given}
        columns |= {name: captured.columns[name] for name in sorted(wanted)}
        read = _filled(t, signals["psi"])
        for start, stop in stuck(read, captured.columns["v"], float(np.median(np.diff(t)))):
            columns["psi"][start:stop] = read[start]  # smoothed, it would not look stuck
        noise |= captured.noise
        std |= {name: captured.std[name] for name in sorted(wanted & set(captured.std))}
        bandwidth = captured.bandwidth
    elif needs_path(mapping) and {"x", "y"} <= set(signals):
        x, y, v, course = signals["x"], signals["y"], signals.get("v"), signals.get("course")
        followed = path_motion(t, x, y, v, course, mapping.bandwidth)
        columns |= {name: values for name, values in followed.items() if name not in columns}
    if "vx" in columns and VELOCITY & set(mapping.signals) <= set(columns):
        columns = from_velocity(columns, mapping.measured_point)
    return Stretch(t, columns, noise, std, bandwidth)


def captured_motion(
    t: Array, x: Array, y: Array, psi: Array, measured_point: tuple[float, float], highest: float
) -> Stretch:
    """Differentiates a stretch of motion capture (NaN where a frame is missing) and moves it to the centre of gravity.

    Its columns are x, y, psi, r, v, beta, ax, ay; its noise is of position [m] and heading [rad].

    highest: frequency [Hz] of motion; what is faster is taken for noise.

    Raises:
        ValueError: too few readings.
    """
    position, heading = smooth(t, np.stack([x, y], axis=1), highest), smooth(t, psi, highest)
    psi, r, r_dot = heading.value[:, 0], heading.rate[:, 0], heading.acceleration[:, 0]
    (x, y), (x_dot, y_dot), (x_ddot, y_ddot) = position.value.T, position.rate.T, position.acceleration.T
    point = PlanarMotion(x, y, *to_body(psi, x_dot, y_dot), *to_body(psi, x_ddot, y_ddot))
    centre = at_centre_of_gravity(point, measured_point, psi, r, r_dot)
    v = np.hypot(centre.vx, centre.vy)
    speed_std = float(np.median(position.std[:, 1]))
    heading_std, r_std = (float(np.median(heading.std[:, i])) for i in (0, 1))
    return Stretch(
        t=t,
        columns={
            "x": centre.x,
            "y": centre.y,
            "psi": psi,
            "r": r,
            "v": v,
            "beta": np.unwrap(np.arctan2(centre.vy, centre.vx)),
            "ax": centre.ax,
            "ay": centre.ay,
        },
        noise={"position": position.noise, "heading": heading.noise},
        std={
            "x": float(np.median(position.std[:, 0])),
            "y": float(np.median(position.std[:, 0])),
            "psi": heading_std,
            "r": r_std,
            "v": speed_std,
            "beta": float(np.hypot(speed_std / max(float(np.median(v)), 0.1), heading_std)),
        },
        bandwidth={"position": position.bandwidth, "heading": heading.bandwidth},
    )


def from_velocity(columns: dict[str, Array], point: tuple[float, float]) -> dict[str, Array]:
    """Adds speed and sideslip from a measured velocity, moved to the centre of gravity."""
    along, across = point
    r = columns.get("r", np.zeros_like(columns["vx"]))
    vx = columns["vx"] + r * across
    moved = {"vx": vx, "v": np.abs(vx)}
    if "vy" in columns:
        vy = columns["vy"] - r * along
        moved |= {"vy": vy, "v": np.hypot(vx, vy), "beta": np.unwrap(np.arctan2(vy, vx))}
    return columns | moved | {name: columns[name] for name in ("v", "beta") if name in columns}


def _filled(t: Array, values: Array) -> Array:
    seen = np.isfinite(values)
    return values if seen.all() else np.interp(t, t[seen], values[seen])


def _rough_speed(readings: Readings, seen: NDArray[np.int64]) -> Array | None:
    t, signals = readings.t, readings.signals
    if {"x", "y"} <= set(signals):
        count = max(1, round(SPEED_WINDOW / readings.period / 2))
        x, y = (np.interp(t, t[seen], signals[name][seen]) for name in ("x", "y"))
        ahead, behind = np.minimum(np.arange(len(t)) + count, len(t) - 1), np.maximum(np.arange(len(t)) - count, 0)
        return np.hypot(x[ahead] - x[behind], y[ahead] - y[behind]) / np.maximum(t[ahead] - t[behind], 1e-9)
    name = next((name for name in ("v", "vx", "omega_r") if name in signals), None)
    return None if name is None else np.abs(np.interp(t, t[seen], signals[name][seen]))


def split_sentence(readings: Readings, parts: Sequence[slice], mapping: RecorderMapping, runs: int) -> list[str]:
    """One sentence on why a recording is in parts, and where [s after its first reading]; none of a single part.

    runs: that come of them.
    """
    t = readings.t - readings.t[0]
    found: dict[str, list[tuple[float, float]]] = {}
    for before, after in itertools.pairwise(parts):
        between = slice(before.stop - 1, after.start + 1)
        lost = [name for name, values in readings.signals.items() if not np.isfinite(values[between]).all()]
        if np.max(np.diff(t[between])) > LARGEST_GAP:
            why = "a gap in time"
        elif mapping.moving is None or (lost and _longest_lost(readings, between, lost) > LARGEST_GAP):
            why = f"no reading of {', '.join(lost)}"
        else:
            why = f"not above {mapping.moving.speed:g} m/s"
        found.setdefault(why, []).append((float(t[before.stop - 1]), float(t[after.start])))
    said = "; ".join(f"{why} ({places(at)})" for why, at in found.items())
    return [f"split into {runs} run{'s' * (runs > 1)}: {said}."] if found else []


def _longest_lost(readings: Readings, part: slice, lost: Sequence[str]) -> float:
    seen = np.all([np.isfinite(readings.signals[name][part]) for name in lost], axis=0)
    return max(float(np.ptp(readings.t[part][max(a - 1, 0) : b + 1])) for a, b in spans(~seen))


def places(found: Sequence[tuple[float, float]]) -> str:
    """Spans [s] in words, the first few by their times."""
    shown = ", ".join(f"{start:.2f} to {stop:.2f} s" for start, stop in found[:SHOWN])
    return shown + (f" and {len(found) - SHOWN} more" if len(found) > SHOWN else "")


def reversing_rows(columns: Mapping[str, Array], period: float) -> NDArray[np.bool_]:
    """Rows [n] in which the car reverses; none of a car that never drives forwards, whose sign or heading is wrong.

    Args:
        columns: of the log [n], with `vx`, `vy` where they are known; period: time between rows [s].
    """
    v, beta = columns["v"], columns.get("beta", np.zeros_like(columns["v"]))
    along = columns.get("vx", v * np.cos(beta))
    speed = np.hypot(along, columns.get("vy", v * np.sin(beta)))
    rows, noise = max(round(SHORTEST_REVERSING / period), 1), _velocity_noise(along, period)
    if SURE * noise > BACKWARDS:
        means = min((SURE * noise / BACKWARDS) ** 2, LONGEST_MEAN / SHORTEST_REVERSING)
        along, noise = uniform_filter1d(along, round(means * rows), mode="nearest"), noise / math.sqrt(means)
    backwards = along < -max(BACKWARDS, SURE * noise)
    found = [
        (a, b)
        for a, b in spans(backwards)
        if (b - a) * period >= SHORTEST_REVERSING and min(speed[max(a - 1, 0)], speed[min(b, len(v) - 1)]) < STANDING
    ]
    return in_spans([] if backwards.mean() > 0.95 else found, len(v))


def _velocity_noise(along: Array, period: float) -> float:
    """Standard deviation [m/s] of a velocity's means over 0.1 s, whatever it was made of: slow noisy positions too."""
    found = [0.0]
    for rows in (round(SHORTEST_REVERSING / period), round(2.0 * SHORTEST_REVERSING / period)):
        count = len(along) // rows if rows else 0
        if count > SHORTEST:
            bends = np.diff(along[: count * rows].reshape(count, rows).mean(axis=1), n=2)
            found.append(float(np.median(np.abs(bends))) / (0.6745 * math.sqrt(6.0)))
    return max(found)


def reversing_sentence(t: Array, parts: Sequence[tuple[int, int]], what: str) -> list[str]:
    """One sentence on where the car reverses, with its times t [s], and what becomes of it; none where it does not."""
    shown = places([(t[start], t[stop - 1]) for start, stop in parts])
    return [f"the car reverses from {shown}: {what}."] if parts else []
