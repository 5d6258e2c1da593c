"""Pictures of the blind check: what was said of what, tier by tier, and whether stated probabilities hold."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.gap.evidence.posterior import NONE, UNKNOWN
from drift_drake.view.colours import REFERENCE, RUNS
from drift_drake.view.style import new_figure, save, styled
from experiments.benchmarks.scores import TIERS, UNKNOWNS, Pair, reliability, said, true_name

OUTCOMES = ("right", "one of two", "right and more", "other effect", NONE, UNKNOWN)
NOT_NAMED = "not named"


def draw_scores(pairs: Sequence[Pair], folder: Path) -> None:
    """outcomes.png, reliability.png, and a confusion_TIER.png for each tier that there is."""
    save(outcomes(pairs), folder / "outcomes.png")
    save(reliability_diagrams(pairs), folder / "reliability.png")
    for tier in TIERS:
        some = [pair for pair in pairs if pair[0]["tier"] == tier]
        if some:
            save(confusion(some, tier), folder / f"confusion_{tier}.png")


def outcome(pair: Pair) -> str:
    """How an answer compares with the truth."""
    label, a = pair
    if said(a) == true_name(label):
        return "right"
    if a["verdict"] != "effect":
        return str(a["verdict"])
    causes, truth = set(a["causes"]), set(label["effects"])
    if label["tier"] not in UNKNOWNS and causes < truth:
        return "one of two"
    if label["tier"] not in UNKNOWNS and truth and causes > truth:
        return "right and more"
    return "other effect"


def cells(pair: Pair) -> list[tuple[str, str]]:
    """(truth, said) of one case, an entry for each true effect.

    A true effect that is not named is held against the effects named wrongly, or against NOT_NAMED where none are.
    """
    label, a = pair
    truths = sorted(label["effects"] | label["strange"]) or [NONE]
    if a["verdict"] != "effect":
        return [(truth, str(a["verdict"])) for truth in truths]
    wrong = [cause for cause in a["causes"] if cause not in truths] or [NOT_NAMED]
    out: list[tuple[str, str]] = []
    for truth in truths:
        out += [(truth, truth)] if truth in a["causes"] else [(truth, cause) for cause in wrong]
    return out


@styled
def confusion(pairs: Sequence[Pair], tier: str) -> Figure:
    """True effects by row, named ones by column; the cell that would be right has a frame."""
    counts = Counter(cell for pair in pairs for cell in cells(pair))
    rows = _ordered({truth for truth, _ in counts})
    right = {truth: UNKNOWN if tier in UNKNOWNS else truth for truth in rows}
    columns = _ordered({name for _, name in counts} | set(right.values()))
    table = np.array([[counts[truth, name] for name in columns] for truth in rows])
    figure = new_figure(2.2 + 0.24 * len(columns), 1.9 + 0.2 * len(rows))
    ax = figure.subplots()
    _matrix(ax, table, rows, columns)
    for i, truth in enumerate(rows):
        ax.add_patch(Rectangle((columns.index(right[truth]) - 0.5, i - 0.5), 1, 1, fill=False, ec=RUNS[2], lw=1.2))
    ax.set(xlabel="said", ylabel="true", title=f"{tier}: {len(pairs)} cases")
    return figure


def _ordered(names: set[str]) -> list[str]:
    """The catalogue's order, then the effects that it never had, then the verdicts."""
    last = (NONE, UNKNOWN, NOT_NAMED)
    own = [name for name in CATALOGUE if name in names]
    return own + sorted(names - set(CATALOGUE) - set(last)) + [name for name in last if name in names]


@styled
def outcomes(pairs: Sequence[Pair]) -> Figure:
    """Tiers by row, outcomes by column."""
    tiers = [tier for tier in TIERS if any(label["tier"] == tier for label, _ in pairs)]
    counts = Counter((pair[0]["tier"], outcome(pair)) for pair in pairs)
    columns = [name for name in OUTCOMES if name == "right" or any(counts[tier, name] for tier in tiers)]
    figure = new_figure(1.9 + 0.55 * len(columns), 1.4 + 0.3 * len(tiers))
    ax = figure.subplots()
    _matrix(ax, np.array([[counts[tier, name] for name in columns] for tier in tiers]), tiers, columns)
    ax.set(xlabel="answer", ylabel="tier")
    return figure


def _matrix(ax: Axes, table: np.ndarray, rows: Sequence[str], columns: Sequence[str]) -> None:
    """Counts as a picture, shaded by their share of the row."""
    share = table / np.maximum(table.sum(axis=1, keepdims=True), 1)
    ax.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    ax.grid(visible=False)
    for i, j in zip(*np.nonzero(table), strict=True):
        color = "white" if share[i, j] > 0.5 else "black"
        ax.text(j, i, f"{table[i, j]}", ha="center", va="center", color=color, fontsize=7)
    ax.set_xticks(range(len(columns)), columns, rotation=90)
    ax.set_yticks(range(len(rows)), rows)


@styled
def reliability_diagrams(pairs: Sequence[Pair]) -> Figure:
    """Share that was right against the stated probability of the leading hypothesis, all cases and tier by tier."""
    parts: dict[str, list[Pair]] = {"all": list(pairs)}
    parts |= {tier: some for tier in TIERS if (some := [pair for pair in pairs if pair[0]["tier"] == tier])}
    columns = 4
    rows = -(-len(parts) // columns)
    figure = new_figure(2.1 * columns, 2.3 * rows)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for ax, (name, some) in zip(axes, parts.items(), strict=False):
        _reliability(ax, reliability(some))
        ax.set_title(f"{name}: {len(some)} cases")
    for ax in axes[len(parts) :]:
        ax.set_visible(False)
    figure.supxlabel("stated probability of the answer", fontsize=8)
    figure.supylabel("share that was right", fontsize=8)
    return figure


def _reliability(ax: Axes, bins: Sequence[dict[str, Any]]) -> None:
    ax.plot([0.0, 1.0], [0.0, 1.0], color=REFERENCE, lw=0.7)
    stated, right = (np.array([b[name] for b in bins]) for name in ("stated", "share"))
    ends = np.array([[b["share"] - b["low"], b["high"] - b["share"]] for b in bins]).T
    ax.errorbar(stated, right, np.maximum(ends, 0.0), fmt="o", color=RUNS[0], ms=4, lw=1.0)
    for b in bins:
        ax.annotate(f"{b['count']}", (b["stated"], b["share"]), (-5, -9), textcoords="offset points", fontsize=6,
                    ha="right")  # fmt: skip
    ax.set(xlim=(0.0, 1.03), ylim=(-0.03, 1.03))
