"""The small car's recordings under `watch --calibration`: as they are, and with a change put in on the way.

    python -m experiments.real.watched --hand runs/hand_changes --out runs/watched

Each recording is watched with the car that was calibrated on the others (`experiments.other_worlds.hand_changes` has
made recordings and calibrations), and so are the two that no calibration has. The changes begin at half of the
driving, in either sign. What is done is kept: start again to go on.
"""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.car.log.table import Run, read_case, read_run
from drift_drake.car.vehicle_file import read_vehicle
from drift_drake.common.run_folder import is_done, write_json
from drift_drake.gap.monitoring.baselines import BaselineScores, calibrated_monitor, learn_baseline_scores
from drift_drake.gap.monitoring.watch import rows_of, watched
from experiments.made import RunConfig, begun, tabulated, write_report
from experiments.other_worlds.changes import CHANGES

MAGNITUDES = {"steering_offset": 0.051, "gyro_bias": 0.075, "sideslip_bias": 0.066, "wheel_radius_error": 0.08}
"""Twice the limits of a diagnosis of these recordings (`hand_changes`)."""
CIRCLES, LAPS = ("floor_a_0", "floor_a_1", "floor_a_2"), ("floor_a_3",)
NEW = ("free_driving", "floor_b")


@dataclasses.dataclass(frozen=True)
class Config(RunConfig):
    """What has been calibrated, and where the answers go."""

    hand: Path
    """Folder of `experiments.other_worlds.hand_changes`: its logs and calibrations are used."""


def watch(run: Run, car: Path, scores: BaselineScores) -> list[dict[str, Any]]:
    """The events of a recording with a calibrated car."""
    monitor = calibrated_monitor(scores, run, *read_vehicle(car))
    return [event for judged in watched(monitor, rows_of(run)) for event in judged.events]


def changed_at(run: Run, name: str, magnitude: float, onset: float) -> Run:
    """A run whose columns are those of a changed car from `onset` [s] on; a change that cuts no rows."""
    after, out = CHANGES[name](run, magnitude), dict[str, Any]()
    for field in dataclasses.fields(run):
        values = getattr(run, field.name)
        if isinstance(values, np.ndarray):
            out[field.name] = np.where(run.t < onset, values, getattr(after, field.name))
    return dataclasses.replace(run, **out)


def asked(recording: str, runs: list[Run]) -> dict[str, tuple[Run, float]]:
    """Runs by name, with the time [s] of their change: infinite for those as they are."""
    out = {f"{recording}-{run.name}": (run, np.inf) for run in runs}
    if recording in CIRCLES:
        onset = float(np.mean(runs[0].t[[0, -1]]))
        for name, magnitude in MAGNITUDES.items():
            for q in (magnitude, -magnitude):
                out[f"{recording}-{name}-{q:+g}"] = changed_at(runs[0], name, q, onset), onset
    return out


def row(name: str, run: Run, onset: float, events: list[dict[str, Any]]) -> dict[str, Any]:
    """What was said: false alarms, the delay of the first alarm after the change, and the last cause."""
    alarms = [event["t"] for event in events if event["event"] == "change"]
    causes = [event["cause"] for event in events if event["event"] == "cause" and event["t"] > onset]
    true = name.split("-")[1]
    return {
        "name": name, "minutes": float(min(onset, run.t[-1]) - run.t[0]) / 60.0,
        "false": sum(t < onset for t in alarms),
        "delay": next((t - onset for t in alarms if t >= onset), None),
        "cause": causes[-1] if causes else None, "right": bool(causes) and causes[-1] == true, "events": events,
    }  # fmt: skip


def text(rows: list[dict[str, Any]]) -> str:
    """Two tables: recordings as they are, and changes."""
    plain = [(r["name"], f"{r['minutes']:.1f}", r["false"]) for r in rows if "run_" in r["name"]]
    changes = []
    for name, magnitude in MAGNITUDES.items():
        some = [r for r in rows if f"-{name}-" in r["name"]]
        delays = [r["delay"] for r in some if r["delay"] is not None]
        after = f"{np.median(delays):.1f}" if delays else "-"
        changes.append((f"{name} {magnitude:g}, either sign", f"{len(delays)} of {len(some)}", after,
                        f"{sum(r['right'] for r in some)} of {len(some)}"))  # fmt: skip
    heads = ("change at half of a recording", "reported", "after [s], median", "last cause right")
    return "\n".join([*tabulated(("recording", "minutes", "alarms"), plain), "", *tabulated(heads, changes)])


def main(config: Config) -> None:
    """All recordings."""
    folder = begun("watched", config)
    rows = []
    for recording in (*CIRCLES, *LAPS, *NEW):
        on = [name for name in (*CIRCLES, *LAPS) if name != recording]
        car = config.hand / "cars" / "+".join(on) / "car.yaml"
        scores = None
        for name, (run, onset) in asked(recording, read_case(config.hand / "logs" / recording)).items():
            path = folder / f"{name}.json"
            if not is_done(path):
                logs = [read_run(config.hand / "logs" / one / "run_0.csv") for one in on]
                scores = scores or learn_baseline_scores(logs, *read_vehicle(car))
                write_json(path, row(name, run, onset, watch(run, car, scores)))
            rows.append(json.loads(path.read_text()))
    write_report(folder, text(rows), config)


if __name__ == "__main__":
    run_command(main, Config, __doc__)
