"""What drifts teach for later ones: a gentle figure-8, the figure-8, the loops, each with and without those before.

    python -m experiments.drifting.onward --plant multi_body --vehicles 8 --vehicle-seed 301128 --out runs/onward

Each car is drifted with the adapting model of many structures. A drive begins with the prior, or with what those before
it taught (`--after` of `drift-drake drive`) that held their drifts; where none did it is the same as from the prior,
with another noise. The figure-8 starts in the drift, at 0.4 rad of sideslip (`gentle`) or 0.6; the loops start in grip.
Broken off, it goes on where it was (give `--out`).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from diagrams.command import run_command
from drift_drake.car.log.cases import runs_of
from drift_drake.common.threads import one_blas_thread
from experiments.drifting.again import AgainConfig, Vehicle, after
from experiments.drifting.runs import Maneuver
from experiments.made import begun, tabulated, write_report
from experiments.settings import run_kept

GENTLE, FIRST, AFTER = "gentle figure-8", "figure-8 from the prior", "figure-8 after the gentle one"
DRIVES: dict[str, tuple[Maneuver, tuple[str, ...]]] = {
    GENTLE: ("gentle", ()),
    FIRST: ("figure_8", ()),
    AFTER: ("figure_8", (GENTLE,)),
    "loops from the prior": ("loops", ()),
    "loops after the figure-8": ("loops", (FIRST,)),
    "loops after the gentle figure-8 and the other": ("loops", (GENTLE, AFTER)),
}
"""What is driven, after which drives, by name."""


@one_blas_thread()
def driven_on(vehicle: Vehicle) -> dict[str, Any]:
    """The metrics of a car's drives."""
    logs, drives = dict[str, pd.DataFrame](), dict[str, Any]()
    for seed, (name, (maneuver, before)) in enumerate(DRIVES.items()):
        believes = after(runs_of([logs[one] for one in before]), maneuver)
        logs[name], drives[name] = vehicle.drifted(believes, seed, maneuver)
    return {"vehicle": vehicle.number, "drives": drives}


def text(rows: Sequence[dict[str, Any]]) -> str:
    """A row a drive; errors of a run that was not completed rank behind all others."""

    def cells(name: str) -> tuple[object, ...]:
        runs = pd.DataFrame([row["drives"][name] for row in rows])
        completed = runs["outcome"] == "completed"
        e, beta = (runs[key].where(completed, np.inf).median() for key in ("rms_e", "rms_sideslip_error"))
        held = (completed & (runs["drifting"] >= 0.9)).sum()
        return (name, f"{completed.sum()} of {len(runs)}", f"{held} of {len(runs)}",
                f"{(runs['outcome'] == 'spin').sum()}", f"{e:.3f}", f"{beta:.3f}")  # fmt: skip

    heads = ("drive", "completed", "0.9 of the drifts held", "spins", "RMS e, median [m]", "RMS sideslip error [rad]")
    return "\n".join(tabulated(heads, map(cells, DRIVES)))


def main(config: AgainConfig) -> None:
    """All cars."""
    folder = begun("onward", config)
    rows = run_kept(config.run_on, driven_on, config.cars(), lambda car: folder / f"{car.number:03d}.json", "car")
    write_report(folder, text(rows), config)


if __name__ == "__main__":
    run_command(main, AgainConfig, __doc__)
