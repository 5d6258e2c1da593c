"""Numbers of the information gathering experiment over its vehicles, and their report."""

from collections.abc import Callable
from typing import Any

import numpy as np

MODELS = ("prior", "Once-OCP", "Once-Info", "Twice-Info", "random steering", "slalom")
STATES = ("r", "v", "beta", "omega_r")
PAPER = {  # Table I: ||Lambda_i^{-1}||_2 by state, and their sum
    "prior": (3.05, 27.47, 1.89, 1.57, 33.98),
    "Once-OCP": (1.43, 1.36, 0.56, 0.43, 3.79),
    "Once-Info": (0.81, 1.56, 0.44, 0.47, 3.24),
    "Twice-Info": (0.49, 0.52, 0.31, 0.39, 1.71),
}


def entry(result: dict[str, Any], name: str) -> dict[str, Any] | None:
    """A vehicle's entry of a model; None where its drive was not made."""
    if name in ("Once-Info", "Twice-Info"):
        k = ("Once-Info", "Twice-Info").index(name)
        return result["rounds"][k] if k < len(result["rounds"]) else None
    found: dict[str, Any] = result[name]
    return found


def _spread(values: list[float]) -> dict[str, float]:
    return {"best": float(np.min(values)), "median": float(np.median(values)), "worst": float(np.max(values))}


def _count(results: list[dict[str, Any]], better: Callable[[dict[str, Any]], bool]) -> int:
    return sum(len(result["rounds"]) > 1 and better(result) for result in results)


def _lowest(result: dict[str, Any], name: str) -> bool:
    """Whether Twice-Info's error is the lowest of the four models'."""
    others = [result["prior"], result["Once-OCP"], result["rounds"][0]]
    return all(result["rounds"][1][name] < other[name] for other in others)


def stop_round(rounds: list[dict[str, Any]], stop_below: float) -> int:
    """Rounds that the stopping rule drives: it stops before one whose predicted gain is too small a share of all
    gained before."""
    gained = rounds[0]["obtained"]
    for k in range(1, len(rounds)):
        if rounds[k]["predicted"] < stop_below * gained:
            return k
        gained += rounds[k]["obtained"]
    return len(rounds)


def summarise(results: list[dict[str, Any]], stop_below: float) -> dict[str, Any]:
    """Best, median and worst over vehicles, counts, and the rounds."""
    summary: dict[str, Any] = {"vehicles": len(results), "models": {}, "rounds": []}
    for name in MODELS:
        entries = [found for found in (entry(result, name) for result in results) if found is not None]
        model: dict[str, Any] = {"vehicles": len(entries)}
        for i, state in enumerate(STATES):
            model[f"norm_{state}"] = _spread([found["norms"][i] for found in entries])
            model[f"one_step_{state}"] = _spread([found["one_step"][i] for found in entries])
            model[f"rollout_{state}"] = _spread([found["rollout"][i] for found in entries])
        for key in (
            "total",
            "full_weight_total",
            "one_step_scaled",
            "rollout_scaled",
            "max_e",
            "max_beta",
            "predicted",
            "obtained",
        ):
            if key in entries[0]:
                model[key] = _spread([found[key] for found in entries])
        if "ending" in entries[0]:
            model["not driven to the end"] = sum(found["ending"] != "time" for found in entries)
            model["left the lane"] = sum(found["left_lane"] for found in entries)
        summary["models"][name] = model
    summary["counts"] = {
        "Twice-Info's total norm below Once-OCP's": _count(
            results, lambda r: r["rounds"][1]["total"] < r["Once-OCP"]["total"]
        ),
        "Twice-Info's yaw-rate norm below Once-OCP's": _count(
            results, lambda r: r["rounds"][1]["norms"][0] < r["Once-OCP"]["norms"][0]
        ),
        "Twice-Info's one-step error in drifts the lowest of the four": _count(
            results, lambda r: _lowest(r, "one_step_scaled")
        ),
        "Twice-Info's 2 s rollout error in drifts the lowest of the four": _count(
            results, lambda r: _lowest(r, "rollout_scaled")
        ),
    }
    summary["prior total over Twice-Info's"] = _spread(
        [r["prior"]["total"] / r["rounds"][1]["total"] for r in results if len(r["rounds"]) > 1]
    )
    summary["the same, every sample in full"] = _spread(
        [r["prior"]["total"] / r["rounds"][1]["full_weight_total"] for r in results if len(r["rounds"]) > 1]
    )
    for k in range(max(len(result["rounds"]) for result in results)):
        rounds = [result["rounds"][k] for result in results if len(result["rounds"]) > k]
        keys = (
            "predicted",
            "obtained",
            "total",
            "one_step_scaled",
            "rollout_scaled",
            "max_e",
            "max_beta",
            "plan_seconds",
        )
        found: dict[str, Any] = {key: _spread([one[key] for one in rounds]) for key in keys}
        found["vehicles"] = len(rounds)
        found["not driven to the end"] = sum(one["ending"] != "time" for one in rounds)
        found["left the lane"] = sum(one["left_lane"] for one in rounds)
        summary["rounds"].append(found)
    summary["stopping"] = {
        "rule": f"stop before a round whose predicted gain is below {stop_below:g} of all gained before",
        "rounds driven": [stop_round(result["rounds"], stop_below) for result in results],
    }
    return summary


def summarise_halves(vehicles: list[dict[str, dict[str, float]]]) -> dict[str, Any]:
    """Errors on halves of the vehicles' own drives by model, and on how many vehicles each is below Once-Info's."""

    def errors(name: str, kind: str) -> list[float]:
        known = (vehicle[name][kind] for vehicle in vehicles)
        return [np.nan if error is None else error for error in known]  # JSON has no NaN

    return {
        name: {
            kind: _spread(errors(name, kind))
            | {"below Once-Info": int(np.sum(np.less(errors(name, kind), errors("Once-Info", kind))))}
            for kind in ("one_step", "rollout")
        }
        for name in vehicles[0]
        if all(name in vehicle for vehicle in vehicles)
    }


def _cell(spread: dict[str, float], digits: int = 3) -> str:
    return f"{spread['median']:.{digits}g} ({spread['best']:.{digits}g} to {spread['worst']:.{digits}g})"


def markdown(summary: dict[str, Any]) -> str:
    """The report."""
    lines = [
        f"Covariance norms, median (range) over {summary['vehicles']} vehicles; the paper's in the last column",
        "",
        "| model | r | v | beta | omega_r | total | paper's total |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, model in summary["models"].items():
        cells = [_cell(model[f"norm_{state}"]) for state in STATES]
        paper = f"{PAPER[name][-1]:g}" if name in PAPER else ""
        lines.append(f"| {name} | {' | '.join(cells)} | {_cell(model['total'])} | {paper} |")
    lines += [
        "",
        "Error in held-out drifts (one step in units of the model's noise; 2 s rollouts in units of the inputs' scale)",
        "and the true vehicle's largest excursions",
        "",
        "| model | one step | 2 s rollout | abs(e) [m] | abs(beta) [rad] | left the lane | not driven to the end |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, model in summary["models"].items():
        safety = (
            f"{_cell(model['max_e'])} | {_cell(model['max_beta'])} | {model['left the lane']} | "
            f"{model['not driven to the end']}"
            if "max_e" in model
            else "| | |"
        )
        lines.append(f"| {name} | {_cell(model['one_step_scaled'])} | {_cell(model['rollout_scaled'])} | {safety} |")
    lines += [
        "",
        "| round | predicted [nat] | obtained [nat] | total norm | one step | abs(e) | abs(beta) | left the lane | "
        "broken off | CPU time of the vehicle's own plan [s] |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for k, found in enumerate(summary["rounds"]):
        keys = ("predicted", "obtained", "total", "one_step_scaled", "max_e", "max_beta")
        cells = [_cell(found[key]) for key in keys]
        cells += [str(found[key]) for key in ("left the lane", "not driven to the end")]
        cells += [_cell(found["plan_seconds"]) if k > 0 else ""]  # the first plan is all vehicles'
        lines.append(f"| {k + 1} | {' | '.join(cells)} |")
    lines += [
        "",
        "Error in drifts on half of a vehicle's own drives, also after learning from the other half",
        "",
        "| model | one step | 2 s rollout | below Once-Info: one step | 2 s |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, kinds in summary.get("halves", {}).items():
        cells = [_cell(kinds[kind]) for kind in ("one_step", "rollout")]
        cells += [str(kinds[kind]["below Once-Info"]) for kind in ("one_step", "rollout")]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    driven = summary["stopping"]["rounds driven"]
    lines += [""]
    lines += [f"- {text}: {count} of {summary['vehicles']}" for text, count in summary["counts"].items()]
    lines += [
        f"- the prior's total norm over Twice-Info's: {_cell(summary['prior total over Twice-Info' + chr(39) + 's'])}",
        "- the same, had every sample counted in full, as in the paper's recursion: "
        + _cell(summary["the same, every sample in full"]),
        f"- {summary['stopping']['rule']}: {min(driven)} to {max(driven)} rounds, {np.median(driven):g} in the median",
        "- CPU time of a plan: "
        + ", ".join(
            f"{name} {value:.1f}" + (" s" if name != "load average" else "")
            for name, value in summary["plan_seconds"].items()
        ),
        "",
    ]
    return "\n".join(lines)
