"""Scores of diagnoses of single effects: shares with exact 95 % intervals, by car, by effect and by size.

Days with a strange fault, which the catalogue lacks, have figures of their own: right is `unknown`, or a cause and
something else.
"""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.gap.evidence.posterior import NONE, UNKNOWN
from experiments.benchmarks.intervals import binomial
from experiments.benchmarks.scores import said
from experiments.made import tabulated
from experiments.other_worlds.jobs import CRASHED, NO_CAR, REFUSED

FAILED = (REFUSED, CRASHED, NO_CAR)
STRONGER_BELOW = ("steering_rate_limit",)  # effects that act the more the smaller they are
SIZES = {"below its detection limit": (0.0, 1.0), "1 to 2 limits": (1.0, 2.0), "above 2 limits": (2.0, np.inf)}
NO_LIMIT = "these logs have no limit"
SURE = 0.8  # probability above which a catalogued cause alone is sure
TOO = f"+{UNKNOWN}"  # of the name of a hypothesis: and an unknown cause
DECISIONS = ("none", "cause", "cause_open", "undecided")


@dataclasses.dataclass(frozen=True)
class Row:
    """One case: what was true and what was said."""

    world: str
    car: str
    case: str
    effects: dict[str, float]
    answer: dict[str, Any]
    strange: str | None = None  # kind of a fault that the catalogue lacks
    within_tolerances: bool = False  # nothing but what varies from day to day, by less than a gap
    drives: str = ""  # those of the day, relative to the calibration's

    @property
    def truth(self) -> str:
        return UNKNOWN if self.strange else "+".join(sorted(self.effects)) or NONE

    @property
    def said(self) -> str:
        return said(self.answer)

    @property
    def something_else(self) -> bool:
        """Whether a cause is named, and something else that the catalogue lacks."""
        return self.answer["verdict"] == "effect" and bool(self.answer["details"].get("left_over"))

    @property
    def right(self) -> bool:
        return self.said == self.truth or (self.strange is not None and self.something_else)

    @property
    def probability(self) -> float:
        """Of what is said, with an unknown cause or without it."""
        p = self.answer["posterior"]
        more = p.get(self.said + TOO, 0.0) if self.answer["verdict"] == "effect" else 0.0
        return float(p.get(self.said, 0.0) + more)

    @property
    def sure_alone(self) -> bool:
        """Whether a catalogued cause is named, without something else, and with a high probability."""
        return self.answer["verdict"] == "effect" and not self.something_else and self.probability > SURE

    @property
    def held(self) -> bool:
        """Whether the ambiguity set holds the truth, or, of a strange fault, any hypothesis with something else."""
        names = self.answer["ambiguity"]
        return self.truth in names or (self.strange is not None and (self.right or any(n.endswith(TOO) for n in names)))

    @property
    def failed(self) -> bool:
        return self.answer["verdict"] in FAILED

    @property
    def size(self) -> float | None:
        """The effect over its detection limit on this case's logs; None where they have none."""
        if len(self.effects) != 1:
            return None
        name, magnitude = next(iter(self.effects.items()))
        least = self.answer["details"].get("detection", {}).get(name, {}).get("least")
        if not least:
            return None
        return float(least / magnitude) if name in STRONGER_BELOW else float(abs(magnitude) / least)

    @property
    def covered(self) -> list[bool]:
        """For each true effect that is named, whether its 95 % interval holds its magnitude."""
        found = self.answer["magnitudes"]
        return [found[n]["low"] <= q <= found[n]["high"] for n, q in self.effects.items() if n in found]


def share(flags: Iterable[bool]) -> dict[str, Any]:
    """Share of true flags with its exact 95 % interval, and how many of how many."""
    flags = list(flags)
    if not flags:
        return {"share": None, "low": 0.0, "high": 1.0, "hits": 0, "count": 0}
    p, low, high = binomial(sum(flags), len(flags))
    return {"share": p, "low": low, "high": high, "hits": sum(flags), "count": len(flags)}


def median_of(values: Iterable[float]) -> float | None:
    """The median; None of nothing."""
    values = list(values)
    return float(np.median(values)) if values else None


def mean_of(values: Iterable[float]) -> float | None:
    """The mean; None of nothing."""
    values = list(values)
    return float(np.mean(values)) if values else None


def scores(rows: Sequence[Row]) -> dict[str, Any]:
    """All figures of some cases, but for strange faults (`strange_scores`). One without an answer counts as wrong."""
    rows = [row for row in rows if not row.strange]
    gaps = [row for row in rows if row.effects]
    nothing = [row for row in rows if not row.effects]
    answered = [row for row in rows if not row.failed]
    named = [row for row in gaps if row.right]
    return {
        "right": share(row.right for row in rows),
        "effects named": share(row.right for row in gaps),
        "effects in the ambiguity set": share(row.held for row in gaps),
        "days with none: false alarms": share(row.said not in (NONE, *FAILED) for row in nothing),
        "days with none: an effect is named": share(row.answer["verdict"] == "effect" for row in nothing),
        "days with variation within tolerances alone: false alarms": share(
            row.said not in (NONE, *FAILED) for row in nothing if row.within_tolerances
        ),
        "effects called none": share(row.said == NONE for row in gaps),
        "effects called unknown": share(row.said == UNKNOWN for row in gaps),
        "without an answer": share(row.failed for row in rows),
        "intervals that hold the magnitude": share(flag for row in gaps for flag in row.covered),
        "ambiguity set, mean size": mean_of(len(row.answer["ambiguity"]) for row in answered),
        "reduction where right, median": median_of(row.answer["reduction"]["estimate"] for row in named),
        "seconds a case, median": median_of(row.answer["seconds"] for row in answered),
        "seconds of CPU a case, median": median_of(row.answer["cpu_seconds"] for row in answered),
        "seconds of CPU a case, most": max((row.answer["cpu_seconds"] for row in answered), default=None),
    }  # fmt: skip


def strange_scores(rows: Sequence[Row]) -> dict[str, Any]:
    """Figures of strange faults."""
    rows = [row for row in rows if row.strange]
    return {
        "unknown, or a cause and something else": share(row.right for row in rows),
        "unknown": share(row.said == UNKNOWN for row in rows),
        "a cause and something else": share(row.something_else for row in rows),
        f"a catalogued cause alone at p > {SURE:g}": share(row.sure_alone for row in rows),
        "called none": share(row.said == NONE for row in rows),
        "without an answer": share(row.failed for row in rows),
    }


def decision_scores(rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    """By kind of day and decision: how many there are, and how many of these are right."""
    kinds = {
        "without an effect": [row for row in rows if row.truth == NONE],
        "with an effect": [row for row in rows if row.effects],
        "with a strange fault": [row for row in rows if row.strange],
    }
    return {
        kind: {name: share(r.right for r in some if r.answer["details"].get("decision") == name) for name in DECISIONS}
        for kind, some in kinds.items()
        if some
    }


def all_scores(rows: Sequence[Row]) -> dict[str, Any]:
    """All figures, the same by car, effect and size, those of strange faults, and every case that is not right."""
    usual, strange = [row for row in rows if not row.strange], [row for row in rows if row.strange]
    kinds = sorted({str(row.strange) for row in strange})
    return {
        "all": scores(usual),
        "by car": grouped(usual, lambda row: row.car),
        "by world": grouped(usual, lambda row: row.world),
        "by drives": grouped([row for row in usual if row.drives], lambda row: row.drives),
        "by effect": grouped(usual, lambda row: row.truth),
        "by size": grouped([row for row in usual if row.effects and not row.failed], size_name),
        "strange faults": strange_scores(strange) if strange else {},
        "by strange fault": {kind: strange_scores([r for r in strange if r.strange == kind]) for kind in kinds},
        "decisions": decision_scores(rows),
        "not right": [mistake(row) for row in rows if not row.right],
    }


def grouped(rows: Sequence[Row], key: Callable[[Row], str]) -> dict[str, Any]:
    """Scores of the rows of each key."""
    return {name: scores([row for row in rows if key(row) == name]) for name in ordered({key(row) for row in rows})}


def ordered(names: Iterable[str]) -> list[str]:
    """The catalogue's order, then the rest by name, `none`, `unknown` and failures last."""
    first = [*CATALOGUE, *SIZES, NO_LIMIT]
    last = [NONE, UNKNOWN, *FAILED]

    def place(name: str) -> tuple[int, str]:
        if name in last:
            return len(first) + 1 + last.index(name), name
        return (first.index(name) if name in first else len(first)), name

    return sorted(names, key=place)


def size_name(row: Row) -> str:
    """Which of `SIZES` the case's effect has."""
    size = row.size
    if size is None:
        return NO_LIMIT
    return next(name for name, (low, high) in SIZES.items() if low <= size < high)


def mistake(row: Row) -> dict[str, Any]:
    """A case that is not right, in short."""
    out = {"world": row.world, "case": row.case, "truth": row.effects, "strange": row.strange, "size": row.size,
           "said": row.said}  # fmt: skip
    if row.failed:
        return out | {"message": row.answer["message"]}
    leading = dict(sorted(row.answer["posterior"].items(), key=lambda item: -item[1])[:4])
    return out | {"posterior": leading, "magnitudes": row.answer["magnitudes"], "truth is in the set": row.held,
                  "reduction": row.answer["reduction"]["estimate"]}  # fmt: skip


def said_share(s: dict[str, Any]) -> str:
    """`17 of 20: 0.85 (0.62 to 0.97)`."""
    if not s["count"]:
        return "-"
    return f"{s['hits']} of {s['count']}: {s['share']:.2f} ({s['low']:.2f} to {s['high']:.2f})"


def said_value(value: Any) -> str:
    """A figure of `scores` in words."""
    if isinstance(value, dict):
        return said_share(value)
    return "-" if value is None else f"{value:.3g}"


COLUMNS = ("right", "effects in the ambiguity set", "effects called none", "effects called unknown",
           "without an answer", "intervals that hold the magnitude", "ambiguity set, mean size")  # fmt: skip
"""Of the tables by group."""


def table_text(title: str, parts: dict[str, Any], columns: Sequence[str] = COLUMNS) -> str:
    """Scores of groups as a Markdown table."""
    rows = [(name, *(said_value(part[c]) for c in columns)) for name, part in parts.items()]
    return "\n".join(tabulated((title, *columns), rows))


def strange_text(result: dict[str, Any]) -> list[str]:
    """Figures of strange faults and of the four decisions as Markdown tables."""
    out = []
    if result["strange faults"]:
        by_kind = {"all": result["strange faults"]} | result["by strange fault"]
        out += ["", table_text("strange fault", by_kind, tuple(result["strange faults"]))]
    if any(s["count"] for part in result["decisions"].values() for s in part.values()):
        out += ["", table_text("days, right of those so decided", result["decisions"], DECISIONS)]
    return out


def scores_text(result: dict[str, Any]) -> str:
    """`all_scores` as Markdown; the brackets hold 95 % intervals."""
    lines = tabulated(("figure", "value (95 %)"), [(name, said_value(q)) for name, q in result["all"].items()])
    for title in ("by car", "by world", "by drives", "by effect", "by size"):
        if result[title]:
            lines += ["", table_text(title.removeprefix("by "), result[title])]
    lines += [*strange_text(result), "", "Not right:"]
    for m in result["not right"]:
        size = "" if m["size"] is None else f", {m['size']:.1f} limits"
        note = m.get("message") or ", ".join(f"{name} {p:.2f}" for name, p in m["posterior"].items())
        truth = m["strange"] or m["truth"] or NONE
        lines.append(f"- {m['world']} {m['case']}: {truth}{size} answered as {m['said']} ({note})")
    return "\n".join(lines) + "\n"
