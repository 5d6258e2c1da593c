"""How far the covariance that a model states of its predictions is right, on cars of other structures.

    python -m experiments.drifting.covariance --plant mujoco --vehicles 6 --vehicle-seed 301301 --out runs/covariance

Each car drifts the figure-8 once with the adapting model of many structures. Of its samples the table has the share
within the 95 % region of what was believed before each (eq. 7): with the noise of the training, and with the noise that
the car's own last samples showed (`drift_drake.drive.learnt.noise`).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import chi2

from diagrams.command import run_command
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.learnt.features import STATE_COUNT
from drift_drake.drive.learnt.noise import within
from experiments.drifting.again import AgainConfig, Vehicle, distances_of
from experiments.drifting.runs import adapting
from experiments.made import begun, tabulated, write_report
from experiments.settings import run_kept

SHARE = 0.95


@one_blas_thread()
def shares(vehicle: Vehicle) -> dict[str, Any]:
    """Of one car's first drift, the shares of samples within both regions, and how it ended."""
    log, metrics = vehicle.drifted(adapting(), 0)
    squares = distances_of(log)
    return {
        "vehicle": vehicle.number, "outcome": metrics["outcome"], "samples": len(squares),
        "stated": float(np.mean(squares <= chi2(STATE_COUNT).ppf(SHARE))),
        "learnt": float(np.mean(within(squares, SHARE))),
    }  # fmt: skip


def text(rows: Sequence[dict[str, Any]]) -> str:
    """A row a car, and the range of both shares."""
    heads = ("car", "the drive", "samples", "within, noise of the training", "within, the car's own noise")
    cells = [(row["vehicle"], row["outcome"], row["samples"], f"{row['stated']:.3f}", f"{row['learnt']:.3f}")
             for row in rows]  # fmt: skip
    spans = [f"{min(row[key] for row in rows):.3f} to {max(row[key] for row in rows):.3f}"
             for key in ("stated", "learnt")]  # fmt: skip
    return "\n".join([*tabulated(heads, cells), "", f"Of {SHARE:.2f} stated: {spans[0]}; with the car's own noise "
                      f"{spans[1]}."])  # fmt: skip


def main(config: AgainConfig) -> None:
    """All cars."""
    folder = begun("covariance", config)
    rows = run_kept(config.run_on, shares, config.cars(), lambda car: folder / f"{car.number:03d}.json", "car")
    write_report(folder, text(rows), config)


if __name__ == "__main__":
    run_command(main, AgainConfig, __doc__)
