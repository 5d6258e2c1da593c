"""What columns say of each other: what looks wrong and how to fix it, what gentle driving tells, overlays."""

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from drift_drake.app.mapping_edits import edit as set_key
from drift_drake.app.mapping_edits import merge, set_global
from drift_drake.app.pages.figures import Chart
from drift_drake.app.pages.parts import box, button, text
from drift_drake.common.errors import significant

Edit = Callable[[Callable[[dict[str, Any]], None], bool], Awaitable[None]]
"""Makes a change to the mapping; whether rows are to be drawn anew."""


def comparison(
    edit: Edit, before: dict[str, Any], found: Any, compared: list[Any], panels: list[Any], gentle: Any
) -> None:
    """What is said of a recording under the mapping `before`; found: `importing.preview.Preview`."""
    if found.refused:
        with box("div", "refusal", role="alert"):
            text("p", f"The import would be refused: {found.refused.sentence}")
            _offered(edit, before, found.refused)
    for remark in found.remarks:
        with box("div", "warning"):
            text("p", remark.sentence)
            _offered(edit, before, remark)
    if not found.refused and not found.remarks and found.pieces:
        text("p", "Signs and units: nothing looks wrong.", "verdict")
    if found.unchecked:
        text("p", f"No other column can check {', '.join(found.unchecked)}.", "note")
    for clause in found.undecided:
        text("p", f"No other column tells {clause}.", "note")
    _estimated(edit, before, gentle)
    for one in compared:
        said = f"correlation {one.likeness:.3f}, gain {significant(one.gain, 3)}"
        text("p", f"{one.column} against {one.against}: {said}", "note")
    if panels:
        Chart(panels, "Columns against what others say of them")


def _estimated(edit: Edit, mapping: dict[str, Any], gentle: Any) -> None:
    """What gentle driving tells of the steering and of where the speed is measured, each to be taken over."""
    line = (mapping.get("signals") or {}).get("delta_cmd")
    point = [float(q) for q in mapping.get("measured_point") or (0.0, 0.0)]
    scale = line.get("scale", 1.0) if isinstance(line, dict) else None
    offers = []
    if gentle.steering is not None and isinstance(scale, int | float) and scale:
        low, middle, high = sorted(
            q / scale for q in (gentle.steering.low, gentle.steering.middle, gentle.steering.high)
        )
        offers.append(("steering ratio", "", low, middle, high, partial(_take_ratio, middle)))
    for axis, (side, found) in enumerate((("ahead", gentle.ahead), ("to the left", gentle.left))):
        if found is not None:
            low, middle, high = (q + point[axis] for q in (found.low, found.middle, found.high))
            offers.append((f"speed is measured {side} by", " m", low, middle, high, partial(_take_point, axis, middle)))
    for what, unit, low, middle, high, change in offers:
        with box("div", "run"):
            span = f"{significant(low, 3)} to {significant(high, 3)}"
            text("span", f"{what}, from gentle driving: {significant(middle, 3)}{unit} ({span}{unit})")
            button(f"Take {significant(middle, 3)}{unit}", partial(edit, change, True), label=f"Take {what}")


def _take_ratio(ratio: float, data: dict[str, Any]) -> None:
    set_key(data, "delta_cmd", "ratio", float(significant(ratio, 4)), [])


def _take_point(axis: int, q: float, data: dict[str, Any]) -> None:
    set_global(data, "measured_point", (axis, round(q, 2)))


def _offered(edit: Edit, before: dict[str, Any], remark: Any) -> None:
    """A button for each way to put it right."""
    with box("div", "run"):
        for fix in remark.fixes:
            button(fix.label[0].upper() + fix.label[1:], partial(_fixed, edit, before, fix))


async def _fixed(edit: Edit, before: dict[str, Any], fix: Any) -> None:
    await edit(lambda data: merge(data, before, fix.mapping), True)
