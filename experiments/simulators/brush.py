"""The brush car as a simulator of the user's: its file, and the function that the file names.

    python -m experiments.simulators.brush small --out runs/small.yaml
    drift-drake simulator check runs/small.yaml

Three cars of `brush_cars.BRUSH_CARS`: a 1:10 car, a lorry, an electric car with a motor at each rear wheel, reached as
any simulator is: by its roll-outs.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro
import yaml

from diagrams.command import run_command
from drift_drake.car.brush.equations import KIND, BrushStates, kinematic_slips
from drift_drake.car.brush.parameters import BrushConstants
from drift_drake.car.compilation import compiled
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import rates
from drift_drake.car.integrate import ramp, runge_kutta
from drift_drake.common.arrays import Array
from drift_drake.common.safe_files import write_text
from experiments.other_worlds.brush_cars import BRUSH_CARS

ROOT = Path(__file__).parents[2]
FORCES = ("force_x", "force_y", "yaw_moment")
SUBSTEPS = 4  # RK4 steps in a step of a roll-out
SAME = ("mass", "yaw_inertia", "front_axle_distance", "rear_axle_distance", "rear_axle_inertia", "friction")
MEANING = {name: name for name in SAME} | {"tyre_relaxation": "relaxation", "front_stiffness": "front_cornering",
                                           "rear_stiffness": "rear_cornering"}  # fmt: skip
UNKNOWN = {"cg_height": 0.15, "front_roll_share": {"deviation": 0.06}, "load_sensitivity": 0.4,
           "sliding_friction": {"deviation": 0.06}}  # fmt: skip
TOLERANCE = {"yaw_inertia": 0.1, "friction": 0.1, "front_stiffness": 0.3, "rear_stiffness": 0.3,
             "rear_axle_inertia": 0.1, "torque": 0.03}  # fmt: skip
CG_TOLERANCE = 0.008  # of the wheelbase


@dataclasses.dataclass(frozen=True)
class BrushFile:
    """A simulator file of a brush car."""

    car: Annotated[Literal["small", "truck", "electric"], tyro.conf.Positional]
    """Which of the cars."""
    out: Path
    """Where to write it (YAML)."""


@compiled
def _roll_out(z: Array, inputs: Array, dt: float, p: BrushConstants, q: Effects, out: Array) -> None:
    """Writes the states [rows, 13] of one roll-out; inputs [rows, 5]: `steering`, `torque`, `FORCES`."""
    k, work, h = np.empty(len(z)), np.empty((2, len(z))), dt / SUBSTEPS
    for row in range(len(inputs)):
        out[row] = z
        if row + 1 < len(inputs):
            a, b = inputs[row], inputs[row + 1]
            car = (p, q, (0.5 * (a[2] + b[2]), 0.5 * (a[3] + b[3]), 0.5 * (a[4] + b[4])))
            for i in range(SUBSTEPS):
                begin, middle = ramp(a[:2], b[:2], i / SUBSTEPS), ramp(a[:2], b[:2], (i + 0.5) / SUBSTEPS)
                runge_kutta(rates, z, begin, middle, ramp(a[:2], b[:2], (i + 1.0) / SUBSTEPS), h, car, k, work)


def simulate(
    start: Mapping[str, Array], inputs: Mapping[str, Array], dt: float, parameters: Mapping[str, float]
) -> dict[str, Array]:
    """Roll-outs [n, rows] of the brush car from (r, v_x, v_y, omega_r) [n]; see `drift_drake.car.foreign`."""
    p = BrushConstants(**parameters)
    given = np.stack([inputs[name] for name in ("steering", "torque", *FORCES)], axis=-1)
    out = np.empty((*given.shape[:2], KIND.size))
    r, v_x, v_y, omega_r = (np.asarray(start[name], dtype=float) for name in ("r", "v_x", "v_y", "omega_r"))
    for i in range(len(out)):
        slips = kinematic_slips(r[i], v_x[i], v_y[i], given[i, 0, 0], 0.0, p)
        own = BrushStates(p.track * r[i], 0.0, 0.0, 0.0, r[i] * v_x[i], 0.0, *slips)
        z = np.array([r[i], np.hypot(v_x[i], v_y[i]), np.arctan2(v_y[i], v_x[i]), omega_r[i], 0.0, *own])
        _roll_out(z, np.ascontiguousarray(given[i]), dt, p, Effects(), out[i])
    v, beta = out[..., 1], out[..., 2]
    return {"r": out[..., 0], "v_x": v * np.cos(beta), "v_y": v * np.sin(beta), "omega_r": out[..., 3],
            "psi": out[..., 4]}  # fmt: skip


def main(config: BrushFile) -> None:
    """Writes the file."""
    car = BRUSH_CARS[config.car]
    same = {name: name for name in ("r", "v_x", "v_y", "omega_r")}
    simulator = {
        "python": f"{__spec__.name if __spec__ else __name__}:simulate", "folder": str(ROOT), "batch": True,
        "inputs": {name: name for name in ("steering", "torque", *FORCES)}, "outputs": {**same, "psi": "psi"},
        "start": same, "parameters": car.constants()._asdict(),
        "meaning": MEANING, "unknown": UNKNOWN,
    }  # fmt: skip
    wheelbase = car.front_axle_distance + car.rear_axle_distance
    tolerance = TOLERANCE | {"front_axle_distance": CG_TOLERANCE * wheelbase}
    data = {"simulator": simulator, "car": {**car.single_track().to_dict(), "tolerance": tolerance}}
    write_text(config.out, yaml.safe_dump(data, sort_keys=False))
    print(f"written to {config.out}")


if __name__ == "__main__":
    run_command(main, BrushFile, __doc__)
