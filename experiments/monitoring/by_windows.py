"""Cars calibrated by prediction under the watch: drives with a change in the middle, and drives without.

    python -m experiments.monitoring.by_windows OUT --car roadster --smooth 8 --first 100 --count 2 --calm 8

OUT/calibration: the car as `identify` finds it from twelve drives, made once. Each seed of `count` makes a drive with
each change, from 6 s on; each of `calm` a drive of each kind without one, half of the kinds not calibrated on.
OUT/drives.json: what was said of each; OUT/report.md: the table.
"""

import dataclasses
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro
from scipy.stats import chi2

from diagrams.command import run_command
from drift_drake.car.effects.catalogue import LIMITS
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.log.table import Run
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.common.run_folder import write_json
from drift_drake.gap.identification.identify import identify
from drift_drake.gap.watching.watch_log import OF_A_CHANGE, watch
from experiments.made import tabulated, write_report
from experiments.monitoring.drives import changed_double_track_drive
from experiments.other_worlds.days import Days, first_guess, make_day, smoothed
from experiments.other_worlds.drivers import DAY_ONE, OTHER

ONSET, DURATION = 6.0, 14.0  # [s]
SOON = 3.0  # [s] after a change
CHANGES = (
    ("friction_level", -0.3), ("friction_level", -0.2), ("steering_lag", 0.1), ("torque_lag", 0.2),
    ("steering_delay", 0.08), ("steering_ratio_error", 0.15), ("torque_gain_error", -0.15),
    ("torque_gain_error", 0.1), ("gyro_bias", 0.02), ("sideslip_bias", -0.02), ("steering_offset", 0.0175),
    ("gyro_gain_error", 0.05), ("speed_gain_error", 0.04), ("wheel_radius_error", -0.025),
)  # fmt: skip
"""A loss of friction, and the middle of the practical range of lags, gains and biases."""


@dataclasses.dataclass(frozen=True)
class Config:
    """Drives of one of the repository's double-track cars."""

    out: Annotated[Path, tyro.conf.Positional]
    car: Literal["coupe", "roadster", "rear_engined", "saloon"] = "roadster"
    smooth: float = 8.0
    """Sensors low-passed without lag at so many Hz; 0: white noise."""
    first: int = 0
    """First seed."""
    count: int = 2
    """Seeds of drives with a change: one of each change."""
    calm: int = 4
    """Seeds of drives without one: one of each kind."""
    calm_duration: float = 14.0
    """[s] of a drive without a change."""
    false_alarms_per_hour: float = 0.3


@dataclasses.dataclass(frozen=True)
class Watched:
    """What was said of one drive."""

    kind: str
    effect: str  # empty: none
    magnitude: float
    seconds: float
    judged: float  # [s]
    shown: bool  # whether the drive could show the change, by the limits that the watch states itself
    reported: float | None  # [s] after the change, or after the start where there is none
    cause: str  # the last one that was named, or that the report led with
    monitored: str  # the same of the monitor alone, without a diagnosis of the rows since the change
    rivals: tuple[str, ...]  # that were named with it
    early: int  # reports before the change
    cpu: float  # [s] that the watch took


def calibrated(config: Config) -> tuple[Path, Path]:
    """The car's file and its calibration's."""
    folder = config.out / "calibration"
    car, found = folder / "car.yaml", folder / "car.json"
    if not found.exists():
        days = Days(Path(), car=config.car, seed=config.first, smooth=config.smooth)
        runs = make_day(days, {}, DAY_ONE * 3, 0)
        result = identify(runs, first_guess(config.car), case=config.car, criterion="prediction")
        write_vehicle(car, result.vehicle, result.effects)
        write_json(found, result.calibration)
    return car, found


def drives(config: Config) -> Iterator[tuple[str, str, float, Run]]:
    """Kind, effect, magnitude and the run of each drive."""
    kinds = (*DAY_ONE, *OTHER)
    jobs = [(kind, "", 0.0, config.first + i) for i in range(config.calm) for kind in kinds]
    jobs += [(kinds[(i + 3 * j) % len(kinds)], name, q, config.first + 1000 + j)
             for j in range(config.count) for i, (name, q) in enumerate(CHANGES)]  # fmt: skip
    for kind, name, q, seed in jobs:
        effects = make_effects({name: q}) if name else Effects()
        duration = DURATION if name else config.calm_duration
        run = changed_double_track_drive(kind, effects, ONSET, seed, duration, config.car)
        if run.t[-1] > ONSET + SOON:
            yield kind, name, q, smoothed(run, config.smooth) if config.smooth else run


def watched(config: Config, files: tuple[Path, Path], kind: str, name: str, q: float, run: Run) -> Watched:
    """What the watch says of a drive."""
    began = time.process_time()
    seen = watch(run, *files, false_alarms_per_hour=config.false_alarms_per_hour)
    cpu = time.process_time() - began
    begins = ONSET if name else 0.0
    events = [event for event in seen.events if event["event"] in OF_A_CHANGE]
    late = [event for event in events if event["t"] > begins]
    reports = [event["t"] - begins for event in late if event["event"] == "change"]
    named = [{"cause": ""}, *(event for event in late if "cause" in event)]
    last, alone = named[-1], next(event["cause"] for event in reversed(named) if "diagnosed" not in event)
    return Watched(
        kind, name, q, float(run.t[-1]), seen.judged, bool(name) and shows(seen.limits, name, q),
        reports[0] if reports else None, last["cause"], alone, (*last.get("rivals", ()), *last.get("or", ())),
        len(events) - len(late), cpu,
    )  # fmt: skip


def shows(limits: dict[str, float | None], name: str, q: float) -> bool:
    """Whether a magnitude is beyond what the drive could have shown."""
    least = limits.get(name)
    return least is not None and (q <= least if name in LIMITS else abs(q) >= abs(least))


def table(found: Sequence[Watched]) -> str:
    """The counts, as Markdown."""
    calm, changed = [w for w in found if not w.effect], [w for w in found if w.effect]
    hours = (sum(w.judged for w in calm) + sum(min(ONSET, w.judged) for w in changed)) / 3600.0
    alarms = sum(w.reported is not None for w in calm) + sum(w.early > 0 for w in changed)
    rows = []
    for label, some in (("all", changed), ("that the drive could show", [w for w in changed if w.shown])):
        hit = [w for w in some if w.reported is not None]
        soon = sum(w.reported is not None and w.reported <= SOON for w in some)
        right, among = (sum(w.effect in (w.cause, *more) for w, more in zip(hit, others, strict=True))
                        for others in ([()] * len(hit), [w.rivals for w in hit]))  # fmt: skip
        count = f"{np.mean([len(w.rivals) for w in hit]):.1f}" if hit else "-"
        delay = f"{np.median([w.reported for w in hit if w.reported is not None]):.1f}" if hit else "-"
        alone = sum(w.effect == w.monitored for w in hit)
        rows.append((f"{label}: {len(some)}", soon, len(hit), alone, right, among, count, delay))
    heads = ("changes", "reported within 3 s", "at all", "last cause right by the monitor alone",
             "with the diagnosis", "right, or among its rivals", "rivals, mean", "median delay [s]")  # fmt: skip
    share = sum(w.judged for w in calm) / max(sum(w.seconds for w in calm), 1e-9)
    low, high = poisson(alarms)
    rate = f"{alarms / max(hours, 1e-9):.2f} (95 %: {low / max(hours, 1e-9):.2f} to {high / max(hours, 1e-9):.2f})"
    cost = sum(w.cpu for w in found) / max(sum(w.seconds for w in found), 1e-9)
    return "\n".join([
        *tabulated(heads, rows), "",
        f"Without a change: {alarms} false alarms in {hours:.2f} h judged ({share:.0%} of the driving), "
        f"{rate} in an hour. CPU: {cost:.0%} of a core.",
    ])  # fmt: skip


def poisson(count: int) -> tuple[float, float]:
    """Exact 95 % interval of the mean of a count (Garwood 1936)."""
    return float(chi2.ppf(0.025, 2 * count)) / 2.0 if count else 0.0, float(chi2.ppf(0.975, 2 * count + 2)) / 2.0


def main(config: Config) -> None:
    """Makes, watches and counts; prints the table."""
    files = calibrated(config)
    found = [watched(config, files, *drive) for drive in drives(config)]
    write_json(config.out / "drives.json", found)
    write_report(config.out, table(found), config)


if __name__ == "__main__":
    run_command(main, Config, __doc__)
