"""Makes the package's sample log, which the demo diagnoses: four runs of a car that nobody chose.

    python -m experiments.demo_log

The effect and the deviations from the vehicle file within tolerance are drawn from the operating system's randomness.
Effects of the sensors alone are not drawn: they would not be seen in the replay of the car's motion.
"""

import secrets
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import COLUMNS, Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.cli.demo import SAMPLE_LOG
from drift_drake.common.run_folder import write_json
from experiments.benchmarks.drake_cases import drake_case
from experiments.benchmarks.truths import Truth, drawn_deviations, drawn_magnitude

FOLDER = Path(str(SAMPLE_LOG))
TRUTH = "truth.json"
SENSORS = ("gyro_bias", "sideslip_bias", "wheel_radius_error", "sensor_latency")
DECIMALS = {"t": 2, "x": 3, "y": 3, "v": 3, "omega_r": 3, "ax": 3, "ay": 3, "tau_cmd": 3}  # all below the noise
OTHER_DECIMALS = 5  # of angles [rad]


def main() -> None:
    """Writes the case folder; the truth next to it is read by the demo's last section only."""
    vehicle, rng = VehicleParameters(), np.random.default_rng(secrets.randbits(128))
    name = str(rng.choice([effect for effect in CATALOGUE if effect not in SENSORS]))
    truth = Truth({name: drawn_magnitude(rng, name, vehicle.tolerance)}, {}, drawn_deviations(rng, vehicle.tolerance))
    FOLDER.mkdir(parents=True, exist_ok=True)
    for run in drake_case(truth, vehicle, rng):
        known: dict[str, Any] = {c: v for c in COLUMNS if (v := run.column(c)) is not None}
        columns: dict[str, Any] = {c: np.round(v, DECIMALS.get(c, OTHER_DECIMALS)) for c, v in known.items()}
        write_run(Run(run.name, **columns), FOLDER / f"{run.name}.csv.gz")
    write_json(FOLDER / TRUTH, truth)


if __name__ == "__main__":
    run_command(main)
