"""What torque each recording asks for in steady turns at the same speed: a difference between recordings, no model.

    python -m experiments.real.steady_turns --data ../shared/data --out runs/steady_turns

The small car's recordings on floor a. Rows count that turn steadily at a nearly constant speed, by speed and direction.
"""

import dataclasses
import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from diagrams.command import run_command
from drift_drake.car.log.table import Run
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import read_mapping
from experiments.made import RunConfig, begun, tabulated, write_results
from experiments.other_worlds.hand_changes import NoDataError

SPEEDS = (0.6, 0.8, 1.0, 1.2, 1.5, 1.8, 2.1)  # [m/s]
AVERAGED = 1.0  # [s]
STEADY = 0.3  # [m/s^2] of the speed, at most
TURNING = 0.8  # [rad/s] of the yaw rate, at least
LEAST_TIME = 3.0  # [s] of rows that make a figure
NAMES = ("turn", "speed_from", "speed_to", "seconds", "torque", "torque_low", "torque_high", "yaw_rate")


@dataclasses.dataclass(frozen=True)
class SteadyTurns(RunConfig):
    """Steady turns of recordings."""

    data: Path
    """Folder with `dart/`."""


def averaged(x: np.ndarray, rows: int) -> np.ndarray:
    """Means over so many rows around each that has as many [rows of the log less `rows` and one more]."""
    return np.asarray(np.convolve(x, np.ones(rows) / rows, "valid"))


def steady_turns(run: Run) -> list[dict[str, float | str]]:
    """By direction and speed: seconds, torque [N m] (median and quartiles), yaw rate [rad/s] (median, absolute)."""
    rows = round(AVERAGED / run.period)
    assert run.tau_cmd is not None  # the mapping's
    v, r, torque = (averaged(x, rows) for x in (run.v, run.r, run.tau_cmd))
    steady = np.abs(np.gradient(v, run.period)) < STEADY
    out = []
    for turn, sign in (("left", 1.0), ("right", -1.0)):
        for low, high in itertools.pairwise(SPEEDS):
            at = steady & (v >= low) & (v < high) & (sign * r > TURNING)
            seconds = float(np.sum(at)) * run.period
            if seconds >= LEAST_TIME:
                least, middle, most = np.quantile(torque[at], [0.25, 0.5, 0.75])
                values = (turn, low, high, seconds, middle, least, most, np.median(np.abs(r[at])))
                out.append({k: x if isinstance(x, str) else float(x) for k, x in zip(NAMES, values, strict=True)})
    return out


def table(found: dict[str, list[dict[str, float | str]]]) -> str:
    """All recordings in one Markdown table."""
    heads = ("recording", "turn", "speed [m/s]", "time [s]", "torque, median (quartiles) [N m]", "yaw rate [rad/s]")
    rows = [
        (name, q["turn"], f"{q['speed_from']} to {q['speed_to']}", f"{q['seconds']:.0f}",
         f"{q['torque']:.4f} ({q['torque_low']:.4f} to {q['torque_high']:.4f})", f"{q['yaw_rate']:.2f}")
        for name, turns in found.items() for q in turns
    ]  # fmt: skip
    return "\n".join(tabulated(heads, rows))


def recordings(data: Path) -> Sequence[Run]:
    """The recordings on floor a, in the order of their times; named as `hand_changes` names them.

    Raises:
        NoDataError: there are none.
    """
    paths = sorted((data / "dart/floor_a").glob("*"))
    if not paths:
        raise NoDataError(f"{data}/dart/floor_a: has no recordings; give the folder of the data set (--data)")
    runs = [import_recordings([path], read_mapping("dart"))[0][0] for path in paths]
    return [dataclasses.replace(run, name=f"floor_a_{i}") for i, run in enumerate(runs)]


def main(config: SteadyTurns) -> None:
    """The table of all recordings."""
    found = {run.name: steady_turns(run) for run in recordings(config.data)}
    folder = begun("steady_turns", config)
    write_results(folder, config, found, table(found))


if __name__ == "__main__":
    run_command(main, SteadyTurns, __doc__)
