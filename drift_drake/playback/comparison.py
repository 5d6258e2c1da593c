"""How far cars are from the real one: RMS errors by state."""

import dataclasses

import numpy as np
import pandas as pd

from drift_drake.playback.side_by_side import Played

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


def wide_table(played: Played) -> pd.DataFrame:
    """One table: t, window, then each column of the real car, as measured, and of the cars, under their names."""
    out = played.real[["t", "window"]].copy()
    for name, table in {"real": played.real, **played.cars}.items():
        kept = table.drop(columns=["t", "window", "delta"])
        out = pd.concat([out, kept.add_prefix(f"{name}_")], axis=1)
    return out.assign(delta_cmd=played.real["delta"])


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
