"""Edits of a mapping's plain data, one line at a time, each made to what the file holds at that moment."""

import shlex
from collections.abc import Sequence
from typing import Any

from drift_drake.app.project import MAPPING, Project
from drift_drake.app.recordings import Recordings
from drift_drake.common.safe_files import write_text
from drift_drake.common.units import DIMENSIONS
from drift_drake.gap.logs.wording.conversion import QUANTITIES, dimension

DEFAULTS = {"sign": 1.0, "scale": 1.0, "offset": 0.0, "frame": ""}


def first_mapping(project: Project, readings: Recordings, name: str) -> None:
    """Writes the mapping that `drift-drake import --look` prints; raises InvalidRecordingError."""
    from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError
    from drift_drake.gap.logs.importing.look import mapping_text

    summary = readings.summary(name)
    if summary.found is None:
        raise InvalidRecordingError(summary.refused)
    write_text(project.folder / MAPPING, mapping_text(summary.found))


def look_command(name: str) -> str:
    """The command that prints it."""
    return f"{shlex.join(['drift-drake', 'import', '--look', name])} > {MAPPING}"


def edit(data: dict[str, Any], quantity: str, key: str, value: Any, candidates: Sequence[Any]) -> None:
    """Sets one key of a quantity's line; an empty column takes the line out, a number that is none the key.

    Args:
        candidates: columns with the units that are stated of them (`importing.candidates`).
    """
    signals = data.setdefault("signals", {})
    if key == "column":
        if not value:
            signals.pop(quantity, None)
            return
        _column(data, signals, quantity, value, candidates)
        return
    line = signals.get(quantity)
    if not isinstance(line, dict):
        return
    if key == "ratio":
        key, value = "scale", 1.0 / value if value else None
    if value is None or value == DEFAULTS.get(key):
        line.pop(key, None)
    else:
        line[key] = value
    if key == "unit" and quantity == "omega_r":
        turns = dimension(str(value)) == "angular rate"
        line.pop("radius", None)
        line |= {"radius": 0.3} if turns else {}


def _column(data: dict[str, Any], signals: dict[str, Any], quantity: str, name: str, candidates: Sequence[Any]) -> None:
    stated = next((one.unit for one in candidates if one.column == name), "")
    clock = {line.get("column"): line.get("clock") for line in signals.values() if isinstance(line, dict)}
    line = {"column": name, "unit": stated or DIMENSIONS[QUANTITIES[quantity]][0]}
    old = signals.get(quantity)
    kept = clock.get(name) or (old.get("clock") if isinstance(old, dict) else None)
    signals[quantity] = line | ({"clock": kept} if kept and kept in data.get("clocks", {}) else {})


def set_global(data: dict[str, Any], key: str, value: Any) -> None:
    """Sets what is said of the whole file; None takes it out. Of `measured_point` one of the two is set."""
    if key == "measured_point":
        place, q = value
        point = [float(one or 0.0) for one in (data.get(key) or [0.0, 0.0])]
        point[place] = q or 0.0
        value = point if any(point) else None
    data.pop(key, None)
    if value is not None:
        data[key] = value


def merge(data: dict[str, Any], before: dict[str, Any], after: dict[str, Any]) -> None:
    """Makes the changes that lead from `before` to `after` to `data`, which somebody else may have changed too."""
    for key in {**before, **after}:
        old, new = before.get(key), after.get(key)
        if isinstance(old, dict) and isinstance(new, dict) and isinstance(data.get(key), dict):
            merge(data[key], old, new)
        elif key not in after:
            data.pop(key, None)
        elif old != new or key not in before:
            data[key] = new
