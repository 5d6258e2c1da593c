"""What a mapping's signals, and what is derived from them, tell: which quantities, and whether they make a log."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from drift_drake.gap.logs.importing.formula import names_in

if TYPE_CHECKING:
    from drift_drake.gap.logs.importing.mapping import RecorderMapping

NEEDED = ("r", "v", "delta_cmd")
POSITION = {"latitude", "longitude"}
NAMES = {"r": "yaw rate", "v": "speed", "delta_cmd": "steering command"}
NEITHER = ("it", "these")
OF_PATH = {"course", "course_rate", "path_ax", "path_ay"}  # derived from positions, for formulas and tables of paths


def is_captured(mapping: "RecorderMapping") -> bool:
    """Whether position and heading are on the log's clock, so that all motion can be derived."""
    here = _on_first_clock(mapping)
    return "psi" in here and ({"x", "y"} <= here or here >= POSITION)


def is_followed(mapping: "RecorderMapping") -> bool:
    """Whether a satellite receiver's position is on the log's clock, so that its path can be followed."""
    return _on_first_clock(mapping) >= POSITION


def derived_quantities(mapping: "RecorderMapping") -> set[str]:
    """Quantities that are derived from the signals before formulas are read."""
    found = set(mapping.derive) if is_captured(mapping) else {"v", *OF_PATH} if is_followed(mapping) else set()
    signals = set(mapping.signals)
    return found | ({"v", "beta"} if {"vx", "vy"} <= signals else {"v"} if "vx" in signals else set())


def missing_quantities(mapping: "RecorderMapping") -> list[str]:
    """What a log needs and nothing gives."""
    known = {*mapping.signals, *derived_quantities(mapping), *mapping.formulas, *mapping.constants}
    return [name for name in NEEDED if name not in known]


def is_path_only(mapping: "RecorderMapping") -> bool:
    """Whether the path of a satellite receiver is known, and too little else for a log."""
    return is_followed(mapping) and bool(missing_quantities(mapping))


def needs_path(mapping: "RecorderMapping") -> bool:
    """Whether the motion along the path has to be derived: for want of a speed, for a formula, or as all there is."""
    read = {name for formula in mapping.formulas.values() for name in names_in(formula)}
    wanted = is_path_only(mapping) or "v" not in mapping.signals or bool(read & (OF_PATH - set(mapping.signals)))
    return is_followed(mapping) and wanted


def wrong_position(mapping: "RecorderMapping") -> str | None:
    """What is wrong with latitude and longitude in a sentence, None if nothing is."""
    given = POSITION & set(mapping.signals)
    if len(given) == 1:
        return f"signals.{given.pop()} is one half of a position; map latitude and longitude"
    if given and {"x", "y"} & set(mapping.signals):
        return "signals have x or y as well as latitude and longitude, which x and y are made of; take one pair out"
    if given and len({mapping.signals[name].clock for name in POSITION}) > 1:
        return "signals.latitude and signals.longitude are on two clocks; give them the same"
    return None


def _on_first_clock(mapping: "RecorderMapping") -> set[str]:
    return {name for name, signal in mapping.signals.items() if signal.clock == mapping.first_clock}


def not_given(missing: Sequence[str]) -> str:
    """What a position without some of the quantities that a log needs cannot tell."""
    names = " and no ".join(NAMES[name] for name in missing)
    instead = (
        ", or, of gentle driving, take the course's rate for it (formulas: {r: course_rate})" if "r" in missing else ""
    )
    rest = NEITHER[len(missing) > 1]
    return (
        f"A position gives path, speed, course and lateral acceleration. There is no {names}, so the sideslip "
        f"cannot be known, and check, identify, diagnose, choose and watch cannot be used: record {rest} too{instead}."
    )
