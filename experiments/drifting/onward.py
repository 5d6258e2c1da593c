"""The loops with what the figure-8 taught, next to the loops from the prior.

    python -m experiments.drifting.onward --plant multi_body --vehicles 8 --vehicle-seed 301128 --out runs/onward

Each car drifts the figure-8, which starts in the drift, with the adapting model of many structures, then the loops,
which start in grip: with that model anew (`from the prior`), and so that it begins with what the figure-8 taught
(`after the figure-8`; the same as from the prior where the figure-8 did not hold its drifts). Broken off, it goes on
where it was (give `--out`).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from diagrams.command import run_command
from drift_drake.car.log.cases import runs_of
from drift_drake.car.log.table import InvalidLogError
from drift_drake.common.threads import one_blas_thread
from experiments.drifting.again import AgainConfig, Vehicle
from experiments.drifting.runs import adapting, adapting_after
from experiments.made import begun, tabulated, write_report
from experiments.settings import run_kept

LOOPS = 1  # seed of the noise in the loops
DRIVES = ("figure-8", "loops from the prior", "loops after the figure-8")


@one_blas_thread()
def driven_on(vehicle: Vehicle) -> dict[str, Any]:
    """The metrics of a car's drives, and why its figure-8 taught nothing, if so."""
    drives, refused = dict[str, Any](), ""
    log, drives[DRIVES[0]] = vehicle.drifted(adapting(), 0)
    _, drives[DRIVES[1]] = vehicle.drifted(adapting(), LOOPS, "loops")
    try:
        believes = adapting_after(runs_of([log]), "loops", "figure_8")
        _, drives[DRIVES[2]] = vehicle.drifted(believes, LOOPS, "loops")
    except InvalidLogError as error:
        refused, drives[DRIVES[2]] = str(error), drives[DRIVES[1]]
    return {"vehicle": vehicle.number, "refused": refused, "drives": drives}


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
    said = [f"Car {row['vehicle']}: the figure-8 is refused: {row['refused']}." for row in rows if row["refused"]]
    return "\n".join([*tabulated(heads, map(cells, DRIVES)), "", *said])


def main(config: AgainConfig) -> None:
    """All cars."""
    folder = begun("onward", config)
    rows = run_kept(config.run_on, driven_on, config.cars(), lambda car: folder / f"{car.number:03d}.json", "car")
    write_report(folder, text(rows), config)


if __name__ == "__main__":
    run_command(main, AgainConfig, __doc__)
