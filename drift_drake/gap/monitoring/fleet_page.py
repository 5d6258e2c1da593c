"""A fleet's findings in words, and as a page: for each effect a table of cars and days, and how it is made up."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.gap.estimation.prior import Interval
from drift_drake.gap.monitoring.fleet import FleetFindings, Level, Table
from drift_drake.view.pages.page import Source, page_html

TEMPLATE = Path(__file__).with_name("fleet_page.html")
ORDER: tuple[Level, ...] = ("fleet", "drift", "date", "car", "day")
WORDS = ("effect", "gap", "nominal car", "calibrated car", "probability", "95 % interval")


def lines(found: FleetFindings) -> list[str]:
    """The findings as a command prints them."""
    out = [f"{len(found.cars)} cars, {found.days} days"]
    for term in sorted(found.terms, key=lambda t: (ORDER.index(t.level), t.owner, -t.probability)):
        size = quantity(term.effect, Interval(term.magnitude, term.low, term.high))
        owner = {"fleet": "all cars", "drift": "all cars from the first day to the last"}.get(term.level, term.owner)
        owner = f"all cars on {owner}" if term.level == "date" else owner
        out.append(f"  {owner}: {term.effect} {size}, probability {term.probability:.2f}")
    if not found.terms:
        out.append("  nothing is missing from the simulator")
    out += [f"  outlier: {day}, {z:.1f} standard deviations beyond these effects" for day, z in found.outliers.items()]
    for table in found.tables:
        if table.magnitudes.size > 1:
            out += [f"  {table.effect} over cars and days:", *(f"    {said}" for said in sentences(table))]
    return out


def quantity(effect: str, q: Interval) -> str:
    """A magnitude with its interval."""
    return f"{q.estimate:+.3g}{CATALOGUE[effect].suffix} (95 %: {q.low:.3g} to {q.high:.3g})"


def sentences(table: Table) -> Iterator[str]:
    """How an effect's magnitudes are made up: the parts that can be distinguished from zero."""
    parts, shown = table.parts, 0
    if parts.common is None:
        yield "one car alone: what all cars would have cannot be distinguished from its own"
    named = [("all cars", parts.common), ("all cars, from the first day to the last", parts.drift)]
    named += [(f"{car}, beyond all cars" if parts.common else car, q) for car, q in parts.cars.items()]
    named += [(f"{car}, from the first day to the last, beyond all cars" if parts.drift else
               f"{car}, from the first day to the last", q) for car, q in parts.drifts.items()]  # fmt: skip
    named += [(f"all cars on {day}, beyond their drift", q) for day, q in parts.days.items()]
    for owner, q in named:
        if q is not None and (q.low > 0.0 or q.high < 0.0):
            shown += 1
            yield f"{owner}: {quantity(table.effect, q)}"
    if not shown:
        yield "no part can be distinguished from zero"


def page(found: FleetFindings, logs: Path, vehicle: Path) -> str:
    """The findings as one self-contained HTML file."""
    return page_html(TEMPLATE, WORDS, found=found, said=lines(found)[1:], logs=logs, colour=colour, sentences=sentences,
                     catalogue=CATALOGUE, source=Source(case=logs, vehicle=vehicle))  # fmt: skip


def colour(table: Table, magnitude: float) -> str:
    """Of a cell: blue below zero, orange above, the stronger the larger."""
    most = max(float(np.nanmax(np.abs(table.magnitudes))), 1e-12)
    rgb = "0, 114, 178" if magnitude < 0.0 else "213, 94, 0"
    return f"rgba({rgb}, {0.6 * abs(magnitude) / most:.2f})"
