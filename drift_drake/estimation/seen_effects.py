"""Which effects the columns of a log can show."""

from collections.abc import Sequence

from drift_drake.logs.table import OPTIONAL, Run
from drift_drake.vehicle.catalogue import CATALOGUE


def seen_effects(runs: Sequence[Run], names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Effects that the columns of the log can show, and a warning about missing columns and the others."""
    missing = [name for name in OPTIONAL if any(run.column(name) is None for run in runs)]
    kept = [name for name in names if not set(CATALOGUE[name].needs) & set(missing)]
    lost = [name for name in names if name not in kept]
    if not missing:
        return kept, []
    what = f"column{'s' if len(missing) > 1 else ''} {', '.join(missing)} {'are' if len(missing) > 1 else 'is'} missing"
    return kept, [f"{what}: {', '.join(lost)} cannot be judged without" if lost else what]
