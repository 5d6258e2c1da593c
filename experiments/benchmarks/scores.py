"""Scores of a diagnosis's answers against the labels, by tier and effect, with confidence intervals."""

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from experiments.benchmarks.intervals import binomial, bootstrap
from experiments.made import tabulated

Pair = tuple[dict[str, Any], dict[str, Any]]  # (label, answer)
TIERS = ("exact", "tolerance", "none", "pair", "family", "removed")
GAP_TIERS = ("exact", "tolerance", "pair", "family", "removed")
SINGLES = ("exact", "tolerance")
UNKNOWNS = ("family", "removed")
BINS = 5  # of the reliability diagram


def true_name(label: dict[str, Any]) -> str:
    """The hypothesis that is right for a case."""
    if label["tier"] in UNKNOWNS:
        return "unknown"
    return "+".join(sorted(label["effects"])) or "none"


def said(answer: dict[str, Any]) -> str:
    """The hypothesis that an answer names."""
    return "+".join(sorted(answer["causes"])) if answer["verdict"] == "effect" else str(answer["verdict"])


def share(flags: Sequence[bool]) -> dict[str, Any]:
    """Share of true flags, its interval and their number."""
    p, low, high = binomial(int(sum(flags)), len(flags), "wilson")
    return {"share": p, "low": low, "high": high, "count": len(flags)}


def mean_of(values: Sequence[float], statistic: Callable[..., Any] = np.mean) -> dict[str, Any]:
    """The mean (or another statistic) of numbers with its 95 % bootstrap interval, and their number."""
    if not len(values):
        return {"mean": float("nan"), "low": float("nan"), "high": float("nan"), "count": 0}
    numbers = np.asarray(values, dtype=float)
    low, high = bootstrap(numbers, lambda draws: statistic(draws, axis=1))
    return {"mean": float(statistic(numbers)), "low": low, "high": high, "count": len(numbers)}


def scores(pairs: Sequence[Pair]) -> dict[str, Any]:
    """All figures; keys are plain names, values shares with intervals or numbers."""
    by_tier: dict[str, list[Pair]] = {}
    for pair in pairs:
        by_tier.setdefault(pair[0]["tier"], []).append(pair)

    def of(*tiers: str) -> list[Pair]:
        return [pair for tier in tiers for pair in by_tier.get(tier, [])]

    def by(figure: Callable[[list[Pair]], Any]) -> dict[str, Any]:
        return {tier: figure(by_tier[tier]) for tier in TIERS if tier in by_tier} | {"all": figure(list(pairs))}

    def right(some: Sequence[Pair]) -> dict[str, Any]:
        return share([said(a) == true_name(label) for label, a in some])

    def isolation(some: Sequence[Pair]) -> dict[str, Any]:
        return mean_of([a["posterior"].get(true_name(label), 0.0) for label, a in some])

    result: dict[str, Any] = {
        "cases": len(pairs),
        "top-1": by(right),
        "truth in the ambiguity set": by(lambda some: share([true_name(label) in a["ambiguity"] for label, a in some])),
        "ambiguity set's size": by(lambda some: mean_of([len(a["ambiguity"]) for _, a in some])),
        "detection": share([a["verdict"] != "none" for _, a in of(*GAP_TIERS)]),
        "detection by tier": {tier: share([a["verdict"] != "none" for _, a in of(tier)]) for tier in GAP_TIERS},
        "false alarms": share([a["verdict"] != "none" for _, a in of("none")]),
        "isolation": isolation(of(*SINGLES)),
        "isolation by tier": by(isolation),
        "pairs, both named": share([set(a["causes"]) == set(label["effects"]) for label, a in of("pair")]),
        "unknown, recalled": share([a["verdict"] == "unknown" for _, a in of(*UNKNOWNS)]),
        "unknown, precision": share([label["tier"] in UNKNOWNS for label, a in pairs if a["verdict"] == "unknown"]),
        "singles called unknown": share([a["verdict"] == "unknown" for _, a in of(*SINGLES)]),
        "magnitude coverage": interval_coverage(pairs),
        "magnitude coverage, nominal off": interval_coverage(of("tolerance", "pair")),
        "reduction within 0.05 of full": share(
            [abs(a["reduction"]["estimate"] - 1.0) <= 0.05 for label, a in of(*SINGLES) if said(a) == true_name(label)]
        ),
        "reduction's interval holds all of the gap": share(
            [a["reduction"]["high"] >= 1.0 for label, a in of(*SINGLES, "pair") if said(a) == true_name(label)]
        ),
        "Brier score": mean_of([brier(pair) for pair in pairs]),
        "Brier score by tier": by(lambda some: mean_of([brier(pair) for pair in some])),
        "reliability": reliability(pairs),
        "reliability by tier": by(reliability),
        "seconds, median": mean_of([a["seconds"] for _, a in pairs], np.median),
        "seconds, most": float(np.max([a["seconds"] for _, a in pairs])),
        "by effect": by_effect(of(*SINGLES)),
        "by unknown": {
            str(sorted(label["strange"] or label["effects"])): share([said(a) == "unknown"])
            for label, a in of(*UNKNOWNS)
        },
        "mistakes": wrong_answers(pairs),
    }
    return result


def wrong_answers(pairs: Sequence[Pair]) -> list[dict[str, Any]]:
    """The cases that were not answered right, what was true, and what was said."""
    return [
        {"case": label["case"], "tier": label["tier"], "truth": label["effects"] | label["strange"], "said": said(a)}
        for label, a in pairs
        if said(a) != true_name(label)
    ]


def interval_coverage(pairs: Sequence[Pair]) -> dict[str, Any]:
    """How often a named true effect's interval holds its magnitude."""
    flags = []
    for label, a in pairs:
        if label["tier"] not in UNKNOWNS:
            for name, interval in a["magnitudes"].items():
                if name in label["effects"]:
                    flags.append(interval["low"] <= label["effects"][name] <= interval["high"])
    return share(flags)


def brier(pair: Pair) -> float:
    """Squared distance of a posterior from the truth."""
    label, a = pair
    truth = true_name(label)
    p = a["posterior"] | {truth: a["posterior"].get(truth, 0.0)}
    return float(sum((value - (name == truth)) ** 2 for name, value in p.items()))


def reliability(pairs: Sequence[Pair]) -> list[dict[str, float]]:
    """Of the leading hypotheses, by bins of their probability: mean probability, share that was right with interval."""
    lead = [(max(a["posterior"].values()), said(a) == true_name(label)) for label, a in pairs]
    edges = np.linspace(0.0, 1.0, BINS + 1)
    out = []
    for low, high in itertools.pairwise(edges):
        some = [(p, ok) for p, ok in lead if low < p <= high]
        if some:
            out.append({"stated": float(np.mean([p for p, _ in some])), **share([ok for _, ok in some])})
    return out


def by_effect(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Top-1 of single effects, by effect."""
    names = sorted({name for label, _ in pairs for name in label["effects"]})
    return {
        name: share([said(a) == true_name(label) for label, a in pairs if name in label["effects"]]) for name in names
    }


def score_text(result: dict[str, Any]) -> str:
    """The figures as a Markdown table, and the mistakes."""
    figures = list[tuple[object, ...]]()

    def row(name: str, s: Any) -> None:
        if isinstance(s, float):
            figures.append((name, f"{s:.3f}", "", ""))
        elif isinstance(s, dict) and "low" in s:
            value = s["share"] if "share" in s else s["mean"]
            figures.append((name, f"{value:.3f}", f"{s['low']:.2f} to {s['high']:.2f}", s["count"]))
        elif isinstance(s, dict) and name != "by effect" and name != "by unknown":
            for key, part in s.items():
                row(f"{name.removesuffix(' by tier')}, {key}", part)

    for name, value in result.items():
        row(name, value)
    lines = [f"{result['cases']} cases", "", *tabulated(("figure", "value", "95 %", "cases"), figures)]
    lines += ["", "Reliability of the leading hypothesis (stated, right, cases):"]
    lines += [f"- {b['stated']:.2f}, {b['share']:.2f}, {b['count']:.0f}" for b in result["reliability"]]
    lines += ["", "Mistakes:"]
    lines += [f"- {m['case']} ({m['tier']}): {m['truth']} answered as {m['said']}" for m in result["mistakes"]]
    return "\n".join(lines) + "\n"
