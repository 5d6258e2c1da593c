"""Pictures of the worlds' scores: what was said of what, and which effect was right in which world."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from drift_drake.view.colours import REFERENCE, RUNS
from drift_drake.view.style import new_figure, styled
from experiments.other_worlds.scoring import Row, ordered

OUTCOMES = {"right": RUNS[2], "in the ambiguity set": RUNS[5], "wrong": RUNS[1]}
UNSEEN = "#F4F4F2"  # no such case


@styled
def draw_rows(rows: Sequence[Row]) -> Figure:
    """True effects by row: on the left what was said of them, on the right how each world fared."""
    truths = ordered({row.truth for row in rows})
    says = ordered({row.said for row in rows} | set(truths))
    worlds = sorted({row.world for row in rows})
    figure = new_figure(3.2 + 0.17 * len(says) + 0.2 * len(worlds), 2.6 + 0.17 * len(truths))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[max(len(says), 4), max(len(worlds), 4)])
    draw_said(left, rows, truths, says)
    draw_worlds(right, rows, truths, worlds)
    left.set_yticks(range(len(truths)), truths)
    colours = [Patch(color=colour, label=name) for name, colour in OUTCOMES.items()]
    figure.legend(handles=colours, loc="outside upper right", ncols=len(colours))
    return figure


def draw_said(ax: Axes, rows: Sequence[Row], truths: Sequence[str], says: Sequence[str]) -> None:
    """Counts of what was said, shaded by their share of the row; a frame where it would be right."""
    counts = Counter((row.truth, row.said) for row in rows)
    table = np.array([[counts[truth, name] for name in says] for truth in truths])
    shade = table / np.maximum(table.sum(axis=1, keepdims=True), 1)
    ax.imshow(shade, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for i, j in zip(*np.nonzero(table), strict=True):
        ax.text(j, i, f"{table[i, j]}", ha="center", va="center", color="white" if shade[i, j] > 0.5 else "black",
                fontsize=6)  # fmt: skip
    for i, truth in enumerate(truths):
        ax.add_patch(Rectangle((says.index(truth) - 0.5, i - 0.5), 1, 1, fill=False, ec=REFERENCE, lw=0.8))
    ax.grid(visible=False)
    ax.set_xticks(range(len(says)), says, rotation=90)
    ax.set(xlabel="said", ylabel="true", title=f"{len(rows)} cases")


def draw_worlds(ax: Axes, rows: Sequence[Row], truths: Sequence[str], worlds: Sequence[str]) -> None:
    """The worst outcome of each effect in each world, with the share that was right where there are several cases."""
    table = np.zeros((len(truths), len(worlds)), dtype=int)
    for i, truth in enumerate(truths):
        for j, world in enumerate(worlds):
            some = [row for row in rows if row.truth == truth and row.world == world]
            table[i, j] = max((outcome(row) for row in some), default=0)
            if len(some) > 1:
                ax.text(j, i, f"{sum(row.right for row in some)}/{len(some)}", ha="center", va="center", fontsize=5)
    colours = [UNSEEN, *OUTCOMES.values()]
    ax.imshow(table, cmap=ListedColormap(colours), vmin=-0.5, vmax=len(colours) - 0.5, aspect="auto")
    ax.grid(visible=False)
    ax.set_xticks(range(len(worlds)), worlds, rotation=90)
    ax.set(xlabel="world", title="by world")


def outcome(row: Row) -> int:
    """Place in `OUTCOMES`, from one."""
    return 1 if row.right else 2 if row.held else 3
