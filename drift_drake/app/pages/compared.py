"""What columns say of each other: what looks wrong and how to fix it, what gentle driving tells, overlays."""

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any, NamedTuple

from drift_drake.app.mapping_edits import edit as set_key
from drift_drake.app.mapping_edits import merge, set_global
from drift_drake.app.pages.figures import Chart
from drift_drake.app.pages.parts import box, button, text
from drift_drake.common.errors import significant

Edit = Callable[[Callable[[dict[str, Any]], None], bool], Awaitable[None]]
"""Makes a change to the mapping; whether rows are to be drawn anew."""


def comparison(
    edit: Edit, before: dict[str, Any], found: Any, compared: list[Any], panels: list[Any], gentle: Any,
    part: tuple[float, float] | None,
) -> None:  # fmt: skip
    """What is said of a recording under the mapping `before`.

    Args:
        found: `importing.preview.Preview`; gentle: `screening.overlays.Estimates`; part: start and end [s] of what was
            looked at, None of all.
    """
    if part is not None:
        text("p", f"Compared: {part[0]:.0f} to {part[1]:.0f} s of the recording; times here begin with it.", "note")
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
    if panels:
        Chart(panels, "Columns against what others say of them")
    if found.unchecked:
        text("p", f"No other column can check {', '.join(found.unchecked)}.", "note")
    for clause in found.undecided:
        text("p", f"No other column tells {clause}.", "note")
    fixed = [fix.mapping for remark in found.remarks for fix in remark.fixes]
    if any(_steering(mapping) != _steering(before) for mapping in fixed):
        gentle = gentle._replace(steering=None)  # the remark offers it
    _estimated(edit, before, gentle)
    for one in compared:
        said = f"correlation {one.likeness:.3f}, gain {significant(one.gain, 3)}"
        text("p", f"{one.column} against {one.against}: {said}", "note")


class FromGentleDriving(NamedTuple):
    """What gentle driving tells of a number of the mapping: its interval, what is in use, and what takes it over."""

    what: str
    unit: str
    low: float
    middle: float
    high: float
    used: float
    take: Callable[[dict[str, Any]], None]

    @property
    def agrees(self) -> bool:
        return self.low <= self.used <= self.high


def from_gentle_driving(mapping: dict[str, Any], gentle: Any) -> list[FromGentleDriving]:
    """Of the steering ratio and of where the speed is measured; gentle: `screening.overlays.Estimates`."""
    found = []
    line = _steering(mapping)
    scale = line.get("scale", 1.0) if isinstance(line, dict) else None
    if gentle.steering is not None and isinstance(scale, int | float) and scale:
        ends = gentle.steering.low, gentle.steering.middle, gentle.steering.high
        low, middle, high = sorted(q / scale for q in ends)
        found.append(
            FromGentleDriving("steering ratio", "", low, middle, high, 1.0 / scale, partial(_take_ratio, middle))
        )
    point = [float(q) for q in mapping.get("measured_point") or (0.0, 0.0)]
    for axis, (side, one) in enumerate((("ahead", gentle.ahead), ("to the left", gentle.left))):
        if one is not None:
            low, middle, high = (q + point[axis] for q in (one.low, one.middle, one.high))
            what, take = f"speed is measured {side} by", partial(_take_point, axis, middle)
            found.append(FromGentleDriving(what, " m", low, middle, high, point[axis], take))
    return found


def _steering(mapping: dict[str, Any]) -> Any:
    return (mapping.get("signals") or {}).get("delta_cmd")


def _estimated(edit: Edit, mapping: dict[str, Any], gentle: Any) -> None:
    """What gentle driving tells, to be taken over where it contradicts what is in use."""
    for one in from_gentle_driving(mapping, gentle):
        span = f"{significant(one.low, 3)} to {significant(one.high, 3)}{one.unit}"
        says = f"{one.what}, from gentle driving: {significant(one.middle, 3)}{one.unit} ({span})"
        if one.agrees:
            text("p", f"{says}: agrees with {significant(one.used, 3)}{one.unit}, which is in use.", "note")
            continue
        with box("div", "run"):
            text("span", says)
            button(f"Take {significant(one.middle, 3)}{one.unit}", partial(edit, one.take, True),
                   label=f"Take {one.what}")  # fmt: skip


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
