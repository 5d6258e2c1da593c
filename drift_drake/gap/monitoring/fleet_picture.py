"""A fleet as a picture: cars by effects, magnitudes in shares of their practical range."""

import numpy as np
from matplotlib.figure import Figure

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.gap.monitoring.fleet import FleetFindings

ALL = "all cars"


def draw_fleet(found: FleetFindings) -> Figure:
    """Rows: all cars, and the cars that have something of their own; columns: effects; a cell: the magnitude."""
    effects = list(dict.fromkeys(term.effect for term in found.terms)) or ["none"]
    owners = [ALL, *dict.fromkeys(term.owner for term in found.terms if term.level != "fleet")]
    values, labels = np.zeros((len(owners), len(effects))), {}
    for term in found.terms:
        at = owners.index(term.owner or ALL), effects.index(term.effect)
        values[at] = term.magnitude / max(abs(CATALOGUE[term.effect].low), abs(CATALOGUE[term.effect].high))
        labels[at] = f"{term.magnitude:+.3g}"
    figure = Figure(figsize=(2.0 + 1.1 * len(effects), 1.8 + 0.35 * len(owners)), layout="constrained")
    axes = figure.subplots()
    image = axes.imshow(values, cmap="RdBu_r", vmin=-1.0, vmax=1.0, aspect="auto")
    for (row, column), text in labels.items():
        axes.text(column, row, text, ha="center", va="center", color="white" if abs(values[row, column]) > 0.6 else "k")
    axes.set_xticks(range(len(effects)), effects, rotation=30, ha="right")
    axes.set_yticks(range(len(owners)), owners)
    axes.set_title(f"{len(found.cars)} cars, {found.days} days: what is missing from the simulator")
    figure.colorbar(image, ax=axes, label="magnitude, of the practical range")
    return figure
