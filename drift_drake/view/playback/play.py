"""From a log and vehicle files to the simulated cars' motion and the real one's: RMS errors by state, words and 3D."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from drift_drake.car.log.table import InvalidLogError, Run, read_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.view.playback.side_by_side import CarModel, Played, SideBySide

UNITS = {"r": "rad/s", "v": "m/s", "beta": "rad", "omega_r": "m/s", "psi": "rad", "position": "m"}


@dataclasses.dataclass(frozen=True)
class Comparison:
    """Errors of predictions against the log."""

    rms: dict[str, dict[str, float]]  # by state (`UNITS`), then by car
    seconds: float  # of predictions that all cars have: those that the errors are of
    driven: float  # [s] of the log in which the real car neither stood nor spun
    lost: dict[str, list[float]]  # times [s] at which each car spun or stopped
    remarks: list[str]

    def table(self) -> str:
        """The errors as lines of text."""
        cars = list(self.lost)
        lines = [f"{'RMS error':<16}" + "".join(f"{name:>12}" for name in cars)]
        for state, errors in self.rms.items():
            label = f"{state} [{UNITS[state]}]"
            lines.append(f"{label:<16}" + "".join(f"{errors[name]:>12.4g}" for name in cars))
        return "\n".join(lines)


def compare(played: Played) -> Comparison:
    """RMS errors over the rows that every car has, so that a car that is lost does not look better for it.

    Of the states, only those that the log has or that follow from it.
    """
    tables, real = played.cars, played.real
    together = np.all([table["v"].notna() for table in tables.values()], axis=0)
    states = [state for state in UNITS if state == "position" or real[state].notna().any()]
    rms: dict[str, dict[str, float]] = {state: {} for state in states}
    for name, table in tables.items():
        error = (table - real)[together]
        error["psi"] = np.arctan2(np.sin(error["psi"]), np.cos(error["psi"]))
        error["position"] = np.hypot(error["x"], error["y"])
        for state in states:
            rms[state][name] = float(np.sqrt(np.mean(error[state] ** 2)))
    period = float(real["t"].iloc[1] - real["t"].iloc[0])
    driven = float((real["window"] >= 0).sum()) * period
    return Comparison(rms, float(together.sum()) * period, driven, played.lost, list(played.remarks))


def drawn(played: Played) -> dict[str, pd.DataFrame]:
    """The real car's table and the cars', for pictures: rows of NaN break their lines at each restart."""
    window = played.real["window"].to_numpy()
    breaks = np.flatnonzero(np.diff(window) != 0)
    index = np.sort(np.concatenate([np.arange(len(window)), breaks + 0.5]))
    tables = {"real": played.real, **played.cars}
    out = {name: table.reindex(index) for name, table in tables.items()}
    for table in out.values():
        table["t"] = table["t"].ffill()
    out["real"] = out["real"].ffill()  # it does not start again
    return out


def prepare(log: str | Path | Run, vehicles: Mapping[str, CarModel]) -> SideBySide:
    """The diagram for a log, with a car for each vehicle by name, the nominal one first.

    Raises:
        InvalidLogError: names the file, the place and the remedy.
    """
    run = log if isinstance(log, Run) else read_run(log)
    try:
        return SideBySide(run, vehicles)
    except InvalidLogError as error:
        where = run.name if isinstance(log, Run) else log
        raise InvalidLogError(f"{where}: {str(error).removeprefix(run.name + ': ')}") from None


def describe(name: str, comparison: Comparison, restart: float) -> str:
    """What the command prints."""
    every = f"restarted every {restart:g} s" if restart > 0.0 else "never restarted"
    lines = [f"{name}: {comparison.seconds:.1f} s of predictions, {every}", comparison.table()]
    for car, times in comparison.lost.items():
        if times:
            when = ", ".join(f"{t:.1f}" for t in times[:5]) + (", ..." if len(times) > 5 else "")
            lines.append(f"the {car} car spun or stopped at {when} s, and is left out from there to the next restart")
    return "\n".join([*lines, *comparison.remarks])


def write_replay(played: Played, path: Path, name: str, restart: float, vehicle: VehicleParameters) -> None:
    """Writes the 3D replay, with a note on what is seen."""
    from drift_drake.view.pictures.replay import replay  # matplotlib and Meshcat are slow to import

    note = f"Simulated cars start from the real one every {restart:g} s." if restart > 0.0 else ""
    remarks = " ".join(f"{remark[0].upper()}{remark[1:]}." for remark in played.remarks)
    replay(drawn(played), path, parameters=vehicle, title=name, note=f"{note} {remarks}".strip(), camera="follow")
