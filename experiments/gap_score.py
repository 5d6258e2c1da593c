"""Scores of a diagnosis's answers against the labels, by tier and effect, with confidence intervals."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

Pair = tuple[dict[str, Any], dict[str, Any]]  # (label, answer)

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


def wilson(hits: int, count: int) -> tuple[float, float, float]:
    """A share with its 95 % confidence interval (Wilson 1927)."""
    if count == 0:
        return float("nan"), 0.0, 1.0
    z, p = 1.96, hits / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * np.sqrt(p * (1 - p) / count + z * z / (4 * count * count))
    return p, float(middle - half), float(middle + half)


def share(flags: Sequence[bool]) -> dict[str, Any]:
    """Share of true flags, its interval and their number."""
    p, low, high = wilson(int(sum(flags)), len(flags))
    return {"share": p, "low": low, "high": high, "count": len(flags)}


def scores(pairs: Sequence[Pair]) -> dict[str, Any]:
    """All figures; keys are plain names, values shares with intervals or numbers."""
    by_tier: dict[str, list[Pair]] = {}
    for pair in pairs:
        by_tier.setdefault(pair[0]["tier"], []).append(pair)

    def of(*tiers: str) -> list[Pair]:
        return [pair for tier in tiers for pair in by_tier.get(tier, [])]

    def right(some: Sequence[Pair]) -> dict[str, Any]:
        return share([said(a) == true_name(label) for label, a in some])

    isolation = [a["posterior"].get(true_name(label), 0.0) for label, a in of(*SINGLES)]
    result: dict[str, Any] = {
        "cases": len(pairs),
        "top-1": {tier: right(some) for tier, some in by_tier.items()},
        "truth in the ambiguity set": {
            tier: share([true_name(label) in a["ambiguity"] for label, a in some]) for tier, some in by_tier.items()
        },
        "ambiguity set's size, mean": float(np.mean([len(a["ambiguity"]) for _, a in pairs])),
        "detection": share([a["verdict"] != "none" for _, a in of(*GAP_TIERS)]),
        "false alarms": share([a["verdict"] != "none" for _, a in of("none")]),
        "isolation, mean": float(np.mean(isolation)) if isolation else float("nan"),
        "pairs, both named": share([set(a["causes"]) == set(label["effects"]) for label, a in of("pair")]),
        "unknown, recalled": share([a["verdict"] == "unknown" for _, a in of(*UNKNOWNS)]),
        "unknown, precision": share([label["tier"] in UNKNOWNS for label, a in pairs if a["verdict"] == "unknown"]),
        "singles called unknown": share([a["verdict"] == "unknown" for _, a in of(*SINGLES)]),
        "magnitude coverage": coverage(pairs),
        "magnitude coverage, nominal off": coverage(of("tolerance", "pair")),
        "reduction within 0.05 of full": share(
            [abs(a["reduction"]["estimate"] - 1.0) <= 0.05 for label, a in of(*SINGLES) if said(a) == true_name(label)]
        ),
        "Brier score": brier(pairs),
        "reliability": reliability(pairs),
        "seconds, median": float(np.median([a["seconds"] for _, a in pairs])),
        "seconds, most": float(np.max([a["seconds"] for _, a in pairs])),
        "by effect": by_effect(of(*SINGLES)),
        "by unknown": {
            str(sorted(label["strange"] or label["effects"])): share([said(a) == "unknown"])
            for label, a in of(*UNKNOWNS)
        },
        "mistakes": [
            {
                "case": label["case"],
                "tier": label["tier"],
                "truth": label["effects"] | label["strange"],
                "said": said(a),
            }
            for label, a in pairs
            if said(a) != true_name(label)
        ],
    }
    return result


def coverage(pairs: Sequence[Pair]) -> dict[str, Any]:
    """How often a named true effect's interval holds its magnitude."""
    flags = []
    for label, a in pairs:
        if label["tier"] not in UNKNOWNS:
            for name, interval in a["magnitudes"].items():
                if name in label["effects"]:
                    flags.append(interval["low"] <= label["effects"][name] <= interval["high"])
    return share(flags)


def brier(pairs: Sequence[Pair]) -> float:
    """Mean squared distance of the posterior from the truth."""
    out = []
    for label, a in pairs:
        truth = true_name(label)
        p = dict(a["posterior"])
        p.setdefault(truth, 0.0)
        out.append(sum((value - (name == truth)) ** 2 for name, value in p.items()))
    return float(np.mean(out))


def reliability(pairs: Sequence[Pair]) -> list[dict[str, float]]:
    """Of the leading hypotheses, by bins of their probability: mean probability, share that was right, number."""
    lead = [(max(a["posterior"].values()), said(a) == true_name(label)) for label, a in pairs]
    edges = np.linspace(0.0, 1.0, BINS + 1)
    out = []
    for low, high in itertools.pairwise(edges):
        some = [(p, ok) for p, ok in lead if low < p <= high]
        if some:
            out.append(
                {
                    "stated": float(np.mean([p for p, _ in some])),
                    "right": float(np.mean([ok for _, ok in some])),
                    "count": len(some),
                }
            )
    return out


def by_effect(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Top-1 of single effects, by effect."""
    names = sorted({name for label, _ in pairs for name in label["effects"]})
    return {
        name: share([said(a) == true_name(label) for label, a in pairs if name in label["effects"]]) for name in names
    }


def score_text(result: dict[str, Any]) -> str:
    """The figures as a Markdown table, and the mistakes."""
    lines = [f"{result['cases']} cases", "", "| figure | value | 95 % | cases |", "| --- | --- | --- | --- |"]

    def row(name: str, s: Any) -> None:
        if isinstance(s, dict) and "share" in s:
            lines.append(f"| {name} | {s['share']:.3f} | {s['low']:.2f} to {s['high']:.2f} | {s['count']} |")
        elif isinstance(s, float):
            lines.append(f"| {name} | {s:.3f} | | |")

    for name, value in result.items():
        if name in ("top-1", "truth in the ambiguity set"):
            for tier, s in value.items():
                row(f"{name}, {tier}", s)
        else:
            row(name, value)
    lines += ["", "Reliability of the leading hypothesis (stated, right, cases):"]
    lines += [f"- {b['stated']:.2f}, {b['right']:.2f}, {b['count']:.0f}" for b in result["reliability"]]
    lines += ["", "Mistakes:"]
    lines += [f"- {m['case']} ({m['tier']}): {m['truth']} answered as {m['said']}" for m in result["mistakes"]]
    return "\n".join(lines) + "\n"
