"""Runs of one case that cannot be of one car: they disagree among themselves by more than effects and drives do."""

from collections.abc import Sequence

import numpy as np

from drift_drake.logs.screening.relations import KINDS, Relation, relations
from drift_drake.logs.screening.windows import Windows
from drift_drake.vehicle.parameters import VehicleParameters

# Factor between two runs that no difference of drives makes, and the likeness from which a run's own ratio is believed.
APART = {
    "turn": (1.3, 0.9), "path": (1.3, 0.0), "across": (4.0, 0.9), "along": (2.5, 0.9), "rim": (1.25, 0.0),
    "steer": (3.0, 0.95), "drive": (2.5, 0.85),
}  # fmt: skip


def disagreements(names: Sequence[str], windows: Windows, vehicle: VehicleParameters) -> list[tuple[str, str]]:
    """Sentences on runs that disagree with the others, each with its evidence. names: of the runs."""
    by_run = [relations(windows.where(windows.run == index), vehicle) for index in range(len(names))]
    reported: dict[int, list[str]] = {}
    for name, (factor, likeness) in APART.items():
        sizes = {i: _size(found, name, likeness) for i, found in enumerate(by_run)}
        known = {i: size for i, size in sizes.items() if size is not None}
        if len(known) < 2 or max(known.values()) < factor * min(known.values()):
            continue
        odd, usual = _odd_one(known)
        reported.setdefault(odd, []).append(
            f"{KINDS[name].says} is {known[odd]:.3g} there and {usual:.3g} in the others"
        )
    return [
        (
            f"{names[index]} disagrees with the other runs ({'; '.join(texts)}): is it the same car, logged in the "
            "same units? Give the runs of one car",
            "; ".join(texts),
        )
        for index, texts in sorted(reported.items())
    ]


def _size(found: Sequence[Relation], name: str, likeness: float) -> float | None:
    at = next((relation for relation in found if relation.name == name), None)
    return at.size if at is not None and at.sign > 0.0 and at.likeness >= likeness else None


def _odd_one(known: dict[int, float]) -> tuple[int, float]:
    """The run farthest from the median of the others, of two the one farther from one, and that median."""
    usual = {i: float(np.median([size for j, size in known.items() if j != i])) for i in known}
    odd = max(known, key=lambda i: abs(np.log(known[i] / (usual[i] if len(known) > 2 else 1.0))))
    return odd, usual[odd]
