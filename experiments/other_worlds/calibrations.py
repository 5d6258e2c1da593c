"""What calibrations are worth: errors half a second ahead, and whether intervals hold the car's own figures."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from drift_drake.car.car_file import read_car
from experiments.made import tabulated
from experiments.other_worlds.jobs import Calibrate, failure_path
from experiments.other_worlds.scoring import median_of, said_share, said_value, share

OWN_FIGURES = ("gear_ratio", "rear_axle_inertia", "front_axle_distance", "yaw_inertia")
"""That the first guess of a simulated world has right: its tyres alone are guessed."""
IDENTIFIED = 0.5  # of the standard deviation before the logs, below which a parameter is said to be identified


def calibration_row(job: Calibrate, own_figures: bool) -> dict[str, Any]:
    """What one calibration says, as numbers.

    Args:
        own_figures: whether the world (truth.json) or the first guess has the car's own `OWN_FIGURES`.
    """
    if not job.out.exists():
        return {"failed": json.loads(failure_path(job.out).read_text())}
    c = json.loads(job.out.read_text())
    h = c["held_out"]
    row = {
        "criterion": c["criterion"],
        "seconds": c["seconds"],
        "cpu_seconds": c["cpu_seconds"],
        "ratio": [h["ratio"], h["low"], h["high"]],
        "half_second": {
            state: {"first_guess": before, "calibrated": after}
            for state, before, after in zip(h["states"], h["before"][-1], h["after"][-1], strict=True)
        },
        "worse": [state for state, (low, _) in zip(h["states"], h["by_state"], strict=True) if low > 1.0],
        "warnings": c["warnings"],
    }
    if own_figures:
        row["own_figures"] = held_figures(c["parameters"], job.start)
    return row


def held_figures(parameters: dict[str, Any], start: Path) -> dict[str, Any]:
    """Of each of `OWN_FIGURES`: estimate, interval, whether it holds the truth, whether it is said to be identified."""
    known = start.parent / "truth.json"
    own = json.loads(known.read_text()) if known.is_file() else vars(read_car(start)[0])
    out = {}
    for name in OWN_FIGURES:
        if name in parameters:
            p, truth = parameters[name], float(own[name])
            out[name] = {
                "truth": truth,
                "estimate": p["estimate"],
                "low": p["low"],
                "high": p["high"],
                "holds": p["low"] <= truth <= p["high"],
                "identified": p["deviation"] < IDENTIFIED * p["prior"],
            }
    return out


def calibration_scores(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Figures over all cars: errors over the first guess's by state, own figures held, seconds."""
    done = [row for row in rows if "failed" not in row]
    states = list(dict.fromkeys(state for row in done for state in row["half_second"]))
    ratios = {
        state: [e[state]["calibrated"] / e[state]["first_guess"] for row in done if state in (e := row["half_second"])]
        for state in states
    }
    figures = [f for row in done for f in row.get("own_figures", {}).items()]
    names = [name for name in OWN_FIGURES if any(n == name for n, _ in figures)]
    return {
        "cars": len(rows),
        "failed": len(rows) - len(done),
        "no worse than the first guess": share(row["ratio"][0] <= 1.0 for row in done),
        "no state worse, beyond what the logs leave open": share(not row["worse"] for row in done),
        "half-second error over the first guess's, median": {state: median_of(q) for state, q in ratios.items()},
        "half-second error over the first guess's, most": {state: max(q) for state, q in ratios.items()},
        "interval holds the car's own figure": {
            name: share(f["holds"] for n, f in figures if n == name) for name in names
        },
        "holds it or is said not to be identified": {
            name: share(f["holds"] or not f["identified"] for n, f in figures if n == name) for name in names
        },
        "seconds, median": median_of(row["seconds"] for row in done),
        "seconds of CPU, median": median_of(row["cpu_seconds"] for row in done),
        "seconds of CPU, most": max((row["cpu_seconds"] for row in done), default=None),
    }


def calibrations_text(result: dict[str, Any], rows: dict[str, dict[str, Any]]) -> str:
    """Both as Markdown."""
    over_all: list[tuple[str, str]] = []
    for name, value in result.items():
        if isinstance(value, dict) and "count" not in value:
            over_all.append((name, ", ".join(f"{key} {said_value(part)}" for key, part in value.items())))
        else:
            over_all.append((name, said_share(value) if isinstance(value, dict) else said_value(value)))
    cars: list[tuple[str, ...]] = []
    for name, row in rows.items():
        if "failed" in row:
            cars.append((name, row["failed"]["verdict"], row["failed"]["message"], "", ""))
            continue
        errors = ", ".join(f"{s} {e['first_guess']:.2g} {e['calibrated']:.2g}" for s, e in row["half_second"].items())
        figures = ", ".join(
            f"{n} {f['estimate']:.3g} ({f['low']:.3g} to {f['high']:.3g}; {f['truth']:.3g}"
            + ("" if f["identified"] else ", not identified") + ")"
            for n, f in row.get("own_figures", {}).items()
        )  # fmt: skip
        ratio, low, high = row["ratio"]
        cars.append((name, row["criterion"], f"{ratio:.2f} ({low:.2f} to {high:.2f})", errors, figures))
    heads = ("car", "criterion", "errors over the first guess's", "half a second ahead, first guess and calibrated",
             "the car's own figures")  # fmt: skip
    return "\n".join([*tabulated(("calibration", "value"), over_all), "", *tabulated(heads, cars)]) + "\n"
