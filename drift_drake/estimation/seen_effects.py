"""Which effects the columns of a log can show."""

from collections.abc import Sequence

from drift_drake.logs.table import OPTIONAL, Run
from drift_drake.vehicle.catalogue import CATALOGUE


def seen_effects(runs: Sequence[Run], names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Effects that the columns of the log can show, and warnings about the others and about missing columns."""
    missing = [name for name in OPTIONAL if any(run.column(name) is None for run in runs)]
    kept = [name for name in names if not set(CATALOGUE[name].needs) & set(missing)]
    warnings = [f"column {name} is missing: its channel is dropped" for name in missing]
    lost = [name for name in names if name not in kept]
    if lost:
        warnings.append(f"without these columns nothing can be said of {', '.join(lost)}")
    return kept, warnings
