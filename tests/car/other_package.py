"""A package with effects of its own, installed into a folder, and programs that use it."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from drift_drake.car.effects.record import InvalidExtensionError

ROOT = Path(__file__).parents[2]
WIND = """
from drift_drake import Effect
from drift_drake.car.scalar import cos, maximum, minimum, select, sin

def gust(r, v, beta, omega_r, psi, car, magnitude):
    return -magnitude * sin(psi), magnitude * cos(psi), 0.3 * magnitude

def limp(delta, tau, v, magnitude):
    return delta, tau * (1.0 - magnitude)

def drift(r, beta, omega_r, magnitude):
    return magnitude * omega_r, 0.0, 0.0

def boosted(delta, tau, v, magnitude, state):
    return delta, select(0.0, magnitude, minimum(tau, state), tau)

def build_up(r, v, beta, omega_r, delta, tau, car, magnitude, state):
    return (tau - state) / maximum(magnitude, 0.02)

def boost(r, v, beta, omega_r, delta, tau, car, magnitude):
    return tau

SIDE_WIND = Effect("N", -1500.0, 1500.0, "a wind from the fixed frame's right acts with q", needs=("psi",),
                   shown_by="straight stretches there and back", force=gust)
LIMP_MODE = Effect("-", 0.05, 0.6, "torque falls by q", "actuator", needs=("tau_cmd",), actuation=limp)
GYRO_SCALE = Effect("rad/m", -0.005, 0.005, "the yaw rate reads q omega_r more", "sensor", reading=drift)
TURBO_LAG = Effect("s", 0.05, 0.5, "torque rises with a lag of q, and falls at once", "actuator",
                   needs=("tau_cmd",), actuation=boosted, rate=build_up, start=boost)
HALF = Effect("s", 0.05, 0.5, "a state without a start", "actuator", actuation=boosted, rate=build_up)
ENDLESS = Effect("s", 0.05, 0.5, "a rate without a limit", "actuator", actuation=boosted, start=boost,
                 rate=lambda r, v, beta, omega_r, delta, tau, car, q, state: (tau - state) / q)
BUS_DELAY = Effect("s", 0.02, 0.15, "the steering command is late by q", "command", spread=True, delays="delta_cmd")
ENGINE_DELAY = Effect("s", 0.03, 0.2, "the torque command is late by q", "command", needs=("tau_cmd",), spread=True,
                      delays="tau_cmd", shown_by="throttle steps")
EARLY = Effect("s", -0.1, 0.1, "early or late", "command", delays="delta_cmd")
NEEDLESS = Effect("s", 0.03, 0.2, "does not say what it needs", "command", delays="tau_cmd")
BEHIND = Effect("s", 0.02, 0.15, "a delay of actuators", "actuator", delays="delta_cmd")
BROKEN = Effect("N", -1.0, 1.0, "always there", force=lambda r, v, beta, omega_r, psi, car, q: (1.0, 0.0, 0.0))
"""
EFFECTS = {"side_wind": "SIDE_WIND", "limp_mode": "LIMP_MODE", "gyro_scale": "GYRO_SCALE", "turbo_lag": "TURBO_LAG"}
DELAYS = {"bus_delay": "BUS_DELAY", "engine_delay": "ENGINE_DELAY"}


def install_package(folder: Path, name: str, source: str, group: str, points: dict[str, str]) -> None:
    """A package of one module into a folder, with these attributes as entry points of drift_drake's."""
    (folder / f"{name}.py").write_text(source)
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir(exist_ok=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = "\n".join(f"{point} = {name}:{attribute}" for point, attribute in points.items())
    (info / "entry_points.txt").write_text(f"[drift_drake.{group}]\n{lines}\n")


def install(folder: Path, effects: dict[str, str]) -> None:
    install_package(folder, "wind", WIND, "effects", effects)


def run(folder: Path, *arguments: str, jit: bool = False) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {
        "PYTHONPATH": f"{ROOT}:{folder}", "NUMBA_DISABLE_JIT": str(int(not jit)), "XDG_CACHE_HOME": str(folder),
    }  # fmt: skip
    return subprocess.run([sys.executable, *arguments], env=environment, cwd=folder, capture_output=True, text=True)


def refusal(name: str, folder: Path, find: Callable[[], object]) -> str:
    """What `find`, which looks for entry points, says of this folder's package, in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        with pytest.raises(InvalidExtensionError) as error:
            find()
    sys.modules.pop(name, None)
    return str(error.value)
