"""Numbers of the information gathering experiment over its vehicles, and their report."""

from collections.abc import Callable
from typing import Any

import numpy as np

from drift_drake.drive.gathering.plan import CONVERGED
from experiments.made import tabulated

MODELS = ("prior", "Once-OCP", "Once-Info", "Twice-Info", "random steering", "slalom")
STATES = ("r", "v", "beta", "omega_r")
MODEL_KEYS = (
    "total", "full_weight_total", "one_step_scaled", "rollout_scaled", "max_e", "max_beta", "predicted", "obtained",
)  # fmt: skip
ROUND_KEYS = (
    "driven_s", "predicted", "obtained", "total", "one_step_scaled", "rollout_scaled", "max_e", "max_beta",
    "plan_seconds",
)  # fmt: skip
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
    found: dict[str, Any] | None = result.get(name)
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


def _of_model(entries: list[dict[str, Any]]) -> dict[str, Any]:
    """Best, median and worst of one model over its vehicles."""
    model: dict[str, Any] = {"vehicles": len(entries)}
    for i, state in enumerate(STATES):
        for name, key in (("norm", "norms"), ("one_step", "one_step"), ("rollout", "rollout")):
            model[f"{name}_{state}"] = _spread([found[key][i] for found in entries])
    model |= {key: _spread([found[key] for found in entries]) for key in MODEL_KEYS if key in entries[0]}
    return model | _endings(entries) if "ending" in entries[0] else model


def _of_round(rounds: list[dict[str, Any]]) -> dict[str, Any]:
    """The same of one round, for the vehicles that drove it."""
    spreads: dict[str, Any] = {key: _spread([one[key] for one in rounds]) for key in ROUND_KEYS}
    return spreads | {"vehicles": len(rounds)} | _endings(rounds)


def _endings(drives: list[dict[str, Any]]) -> dict[str, int]:
    return {
        "not driven to the end": sum(drive["ending"] not in ("time", "enough") for drive in drives),
        "left the lane": sum(drive["left_lane"] for drive in drives),
    }


def _counts(results: list[dict[str, Any]]) -> dict[str, int]:
    better: dict[str, Callable[[dict[str, Any]], bool]] = {
        "Twice-Info's total norm below Once-OCP's": lambda r: r["rounds"][1]["total"] < r["Once-OCP"]["total"],
        "Twice-Info's yaw-rate norm below Once-OCP's": lambda r: r["rounds"][1]["norms"][0] < r["Once-OCP"]["norms"][0],
        "Twice-Info's one-step error in drifts the lowest of the four": lambda r: _lowest(r, "one_step_scaled"),
        "Twice-Info's 2 s rollout error in drifts the lowest of the four": lambda r: _lowest(r, "rollout_scaled"),
    }
    return {text: _count(results, holds) for text, holds in better.items()}


def _ratios(twice: list[dict[str, Any]]) -> dict[str, Any]:
    """Of the vehicles that drove two rounds; nothing where none did."""
    kinds = {"prior total over Twice-Info's": "total", "the same, every sample in full": "full_weight_total"}
    return {
        name: _spread([result["prior"]["total"] / result["rounds"][1][key] for result in twice])
        for name, key in kinds.items()
        if twice
    }


def plans_found(results: list[dict[str, Any]]) -> dict[str, Any]:
    """How many rounds' plans were driven, how many of those had not converged, and how many failed, by round."""
    driven = [one for result in results for one in result["rounds"]]
    failed = [len(result["rounds"]) + 1 for result in results if "stopped" in result]
    return {
        "driven": len(driven),
        "not converged": sum(one.get("status", CONVERGED) != CONVERGED for one in driven),
        "failed": {str(number): failed.count(number) for number in sorted(set(failed))},
    }


def _plans_sentence(plans: dict[str, Any]) -> str:
    by_round = ", ".join(f"{count} of round {number}" for number, count in plans["failed"].items())
    failed = sum(plans["failed"].values())
    return (
        f"- plans of rounds: {plans['driven']} driven, {plans['not converged']} of them not converged; {failed} failed "
        f"and were not driven{f' ({by_round})' if by_round else ''}"
    )


def summarise(results: list[dict[str, Any]], stop_below: float) -> dict[str, Any]:
    """Best, median and worst over vehicles, counts, and the rounds."""
    by_model = {name: [e for e in (entry(result, name) for result in results) if e is not None] for name in MODELS}
    twice = [result for result in results if len(result["rounds"]) > 1]
    most = max(len(result["rounds"]) for result in results)
    driven = [[result["rounds"][k] for result in results if len(result["rounds"]) > k] for k in range(most)]
    return {
        "vehicles": len(results),
        "plans": plans_found(results),
        "models": {name: _of_model(entries) for name, entries in by_model.items() if entries},
        "rounds": [_of_round(rounds) for rounds in driven],
        "counts": _counts(results),
        **_ratios(twice),
        "stopping": {
            "rule": f"stop before a round whose predicted gain is below {stop_below:g} of all gained before",
            "rounds driven": [stop_round(result["rounds"], stop_below) for result in results],
        },
    }


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


def _cell(spread: dict[str, float]) -> str:
    return f"{spread['median']:.3g} ({spread['best']:.3g} to {spread['worst']:.3g})"


def _norms(summary: dict[str, Any]) -> list[str]:
    said = f"Covariance norms, median (range) over {summary['vehicles']} vehicles; the paper's in the last column"
    rows = []
    for name, model in summary["models"].items():
        cells = [_cell(model[f"norm_{state}"]) for state in STATES]
        paper = f"{PAPER[name][-1]:g}" if name in PAPER else ""
        rows.append((name, *cells, _cell(model["total"]), paper))
    return [said, "", *tabulated(("model", "r", "v", "beta", "omega_r", "total", "paper's total"), rows)]


def _errors(summary: dict[str, Any]) -> list[str]:
    lines = [
        "Error in held-out drifts (one step in units of the model's noise; 2 s rollouts in units of the inputs' scale)",
        "and the true vehicle's largest excursions",
        "",
    ]
    heads = ("model", "one step", "2 s rollout", "abs(e) [m]", "abs(beta) [rad]", "left the lane",
             "not driven to the end")  # fmt: skip
    rows = []
    for name, model in summary["models"].items():
        safety = [""] * 4
        if "max_e" in model:
            safety = [_cell(model["max_e"]), _cell(model["max_beta"]), *(model[head] for head in heads[5:])]
        rows.append((name, _cell(model["one_step_scaled"]), _cell(model["rollout_scaled"]), *safety))
    return [*lines, *tabulated(heads, rows)]


def _rounds(summary: dict[str, Any]) -> list[str]:
    heads = ("round", "driven [s]", "predicted [nat]", "obtained [nat]", "total norm", "one step", "after 2 s",
             "abs(e)", "abs(beta)", "left the lane", "broken off",
             "CPU time of the vehicle's own plan [s]")  # fmt: skip
    rows = []
    for k, found in enumerate(summary["rounds"]):
        keys = ("driven_s", "predicted", "obtained", "total", "one_step_scaled", "rollout_scaled", "max_e", "max_beta")
        cells = [_cell(found[key]) for key in keys]
        cells += [str(found[key]) for key in ("left the lane", "not driven to the end")]
        cells += [_cell(found["plan_seconds"]) if k > 0 else ""]  # the first plan is all vehicles'
        rows.append((k + 1, *cells))
    return tabulated(heads, rows)


def _halves(summary: dict[str, Any]) -> list[str]:
    said = "Error in drifts on half of a vehicle's own drives, also after learning from the other half"
    rows = []
    for name, kinds in summary.get("halves", {}).items():
        cells = [_cell(kinds[kind]) for kind in ("one_step", "rollout")]
        rows.append((name, *cells, *(kinds[kind]["below Once-Info"] for kind in ("one_step", "rollout"))))
    return [said, "", *tabulated(("model", "one step", "2 s rollout", "below Once-Info: one step", "2 s"), rows)]


def _sentences(summary: dict[str, Any]) -> list[str]:
    driven = summary["stopping"]["rounds driven"]
    times = (f"{n} {v:.1f}" + (" s" if n != "load average" else "") for n, v in summary["plan_seconds"].items())
    lines = [f"- {text}: {count} of {summary['vehicles']}" for text, count in summary["counts"].items()]
    ratios = {
        "the prior's total norm over Twice-Info's": "prior total over Twice-Info's",
        "the same, had every sample counted in full, as in the paper's recursion": "the same, every sample in full",
    }
    return [
        *lines,
        _plans_sentence(summary["plans"]),
        *(f"- {text}: {_cell(summary[key])}" for text, key in ratios.items() if key in summary),
        f"- {summary['stopping']['rule']}: {min(driven)} to {max(driven)} rounds, {np.median(driven):g} in the median",
        "- CPU time of a plan: " + ", ".join(times),
    ]


def markdown(summary: dict[str, Any]) -> str:
    """The report."""
    parts = (_norms, _errors, _rounds, _halves, _sentences)
    return "".join("\n".join([*part(summary), "", ""]) for part in parts).removesuffix("\n")
