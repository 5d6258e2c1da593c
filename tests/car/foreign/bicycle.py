"""A bicycle on tanh tyres in NumPy, as a user may have it, and its simulator file: well, or with one mistake in it."""

import copy
import os
import time
from pathlib import Path

import numpy as np
import yaml

PARAMETERS = {
    "m": 1450.0, "J": 2200.0, "lf": 1.2, "lr": 1.3, "mu": 1.0, "cf": 1.2e5, "cr": 1.5e5, "jw": 12.0, "soft": 0.02,
}  # fmt: skip
CALLS = [0]


def rates(z, steer, torque, wrench, p):
    """Rates of z [n, 5]: r, v_x, v_y, wheel speed, steering that follows the rack."""
    r, v_x, v_y, w, angle = z.T
    base, weight, roll = p["lf"] + p["lr"], p["m"] * 9.81, np.maximum(v_x, 1.0)
    front, rear = p["mu"] * weight * p["lr"] / base, p["mu"] * weight * p["lf"] / base
    f_front = -front * np.tanh(p["cf"] * (np.arctan2(v_y + p["lf"] * r, roll) - angle) / front)
    slip_y, slip_x = -np.arctan2(v_y - p["lr"] * r, roll), (0.32 * w - v_x) / roll
    slip = np.hypot(slip_x, slip_y) + 1e-9
    force = rear * np.tanh(p["cr"] * slip / rear) / slip
    f_x, f_y = force * slip_x, force * slip_y
    a_x = (f_x - f_front * np.sin(angle) + wrench[0]) / p["m"]
    a_y = (f_y + f_front * np.cos(angle) + wrench[1]) / p["m"]
    moment = p["lf"] * f_front * np.cos(angle) - p["lr"] * f_y + wrench[2]
    return np.stack([moment / p["J"], a_x + r * v_y, a_y - r * v_x, (torque - 0.32 * f_x) / p["jw"],
                     (steer - angle) / p["soft"]], axis=-1)  # fmt: skip


def simulate(start, inputs, dt, parameters, steps=2, euler=False):
    """Roll-outs by Heun's method, or Euler's; r, vx, vy [SI], w [rad/s], psi [rad]."""
    z = np.stack([start["r"], start["vx"], start["vy"], start["w"], inputs["steer"][:, 0]], axis=-1)
    wrench = [inputs.get(name, np.zeros_like(inputs["steer"])) for name in ("fx", "fy", "mz")]
    columns, h, out = (inputs["steer"], inputs["torque"], *wrench), dt / steps, [z]
    for row in range(inputs["steer"].shape[1] - 1):
        for step in range(steps):
            u, w = ([c[:, row] + share * (c[:, row + 1] - c[:, row]) for c in columns]
                    for share in (step / steps, (step + 1) / steps))  # fmt: skip
            k = rates(z, u[0], u[1], u[2:], parameters)
            z = z + (h * k if euler else 0.5 * h * (k + rates(z + h * k, w[0], w[1], w[2:], parameters)))
        out.append(z)
    r, v_x, v_y, w, _ = np.moveaxis(np.stack(out, axis=1), -1, 0)
    psi = np.concatenate([0.0 * r[:, :1], np.cumsum(0.5 * dt * (r[:, 1:] + r[:, :-1]), axis=1)], axis=1)
    return {"r": r, "vx": v_x, "vy": v_y, "w": w, "psi": psi}


def other_sign(start, inputs, dt, parameters):
    return simulate(start, inputs | {"steer": -inputs["steer"]}, dt, parameters)


def degrees(start, inputs, dt, parameters):
    found = simulate(start, inputs, dt, parameters)
    return found | {"r": np.degrees(found["r"])}


def psi_in_degrees(start, inputs, dt, parameters):
    found = simulate(start, inputs, dt, parameters)
    return found | {"psi": np.degrees(found["psi"])}


def takes_degrees(start, inputs, dt, parameters):
    return simulate(start, inputs | {"steer": np.radians(inputs["steer"])}, dt, parameters)


def starts_centred(start, inputs, dt, parameters):
    """Its wheels stand straight where a roll-out begins, and follow the rack with the lag `soft`."""
    straight = inputs["steer"].copy()
    straight[:, 0] = 0.0
    return simulate(start, inputs | {"steer": straight}, dt, parameters)


def echoes(_start, inputs, dt, _parameters):
    """What it is given to follow."""
    found = {name: inputs[f"led_{name}"] for name in ("r", "vx", "vy", "w")}
    turned = np.cumsum(0.5 * dt * (found["r"][:, 1:] + found["r"][:, :-1]), axis=1)
    return found | {"psi": np.concatenate([0.0 * turned[:, :1], turned], axis=1)}


def starts_at_rest(start, inputs, dt, parameters):
    return simulate(start | {"r": 0.0 * start["r"]}, inputs, dt, parameters)


def starts_straight(start, inputs, dt, parameters):
    return simulate(start | {"vy": 0.0 * start["vx"]}, inputs, dt, parameters)


def coarse(start, inputs, dt, parameters):
    return simulate(start, inputs, dt, parameters | {"cf": 4e5, "cr": 4e5}, steps=1, euler=True)


def one_step(start, inputs, dt, parameters):
    if dt < 0.009:
        raise ValueError("made for 10 ms alone")
    return simulate(start, inputs, dt, parameters)


def late(start, inputs, dt, parameters):
    found = simulate(start, inputs, dt, parameters)
    return found | {"psi": np.concatenate([np.zeros((len(found["psi"]), 4)), found["psi"][:, :-4]], axis=1)}


def after_the_step(start, inputs, dt, parameters):
    found = simulate(start, inputs, dt, parameters)
    return found | {"vx": np.concatenate([0.0 * found["vx"][:, :1], found["vx"][:, :-1]], axis=1)}


def random(start, inputs, dt, parameters):
    found = simulate(start, inputs, dt, parameters)
    return found | {"r": found["r"] + 1e-4 * np.random.default_rng().normal(size=found["r"].shape)}


def keeps_state(start, inputs, dt, parameters):
    CALLS[0] += 1
    found = simulate(start, inputs, dt, parameters)
    return found | {"vx": found["vx"] + 1e-3 * CALLS[0]}


def raises(start, inputs, dt, parameters):
    if parameters["m"] > 1600.0:
        raise ValueError("the matrix is singular")
    return simulate(start, inputs, dt, parameters)


def ends(start, inputs, dt, parameters):
    if parameters["m"] > 1600.0:
        os._exit(3)
    return simulate(start, inputs, dt, parameters)


def hangs(start, inputs, dt, parameters):
    while parameters["m"] > 1600.0:
        time.sleep(0.01)
    return simulate(start, inputs, dt, parameters)


def nothing(start, inputs, dt, parameters):
    return simulate(start, inputs, dt, parameters | {"J": 2200.0})


def not_finite(start, inputs, dt, parameters):
    return {name: values * np.nan for name, values in simulate(start, inputs, dt, parameters).items()}


def forgets(start, inputs, dt, parameters):
    found = simulate(start, inputs, dt, parameters)
    return {name: found[name] for name in ("r", "vx", "vy", "psi")}


def too_short(start, inputs, dt, parameters):
    return {name: values[:, 1:] for name, values in simulate(start, inputs, dt, parameters).items()}


def no_dict(start, inputs, dt, parameters):
    return list(simulate(start, inputs, dt, parameters).values())


DATA = {
    "simulator": {
        "python": "bicycle:simulate", "batch": True,
        "inputs": {"steering": "steer", "torque": {"name": "torque", "ratio": 8.0}, "force_x": "fx", "force_y": "fy",
                   "yaw_moment": "mz"},
        "outputs": {"r": "r", "v_x": "vx", "v_y": "vy", "omega_r": {"name": "w", "unit": "rad/s"}, "psi": "psi"},
        "start": {"r": "r", "v_x": "vx", "v_y": "vy", "omega_r": {"name": "w", "unit": "rad/s"}},
        "parameters": PARAMETERS,
        "meaning": {"mass": "m", "yaw_inertia": "J", "front_axle_distance": "lf", "rear_axle_distance": "lr",
                    "friction": "mu", "front_stiffness": "cf", "rear_stiffness": "cr", "rear_axle_inertia": "jw"},
        "unknown": {"soft": 0.3},
    },
    "car": {"mass": 1450.0, "yaw_inertia": 2200.0, "front_axle_distance": 1.2, "rear_axle_distance": 1.3,
            "wheel_radius": 0.32, "rear_axle_inertia": 12.0, "gear_ratio": 8.0, "friction": 1.0,
            "front_stiffness": 1.2e5, "rear_stiffness": 1.5e5, "gravity": 9.81, "steering_limit": 0.55,
            "torque_min": -60.0, "torque_max": 400.0,
            "tolerance": {"front_stiffness": 0.2, "rear_stiffness": 0.2, "friction": 0.1, "yaw_inertia": 0.1}},
}  # fmt: skip


def written(folder: Path, function: str = "simulate", name: str = "simulator.yaml", **changes) -> Path:
    """A simulator file in a folder; changes: of keys under `simulator:`, None to leave one out."""
    data = copy.deepcopy(DATA)
    data["simulator"] |= {"python": f"bicycle:{function}", "folder": str(Path(__file__).parent)} | changes
    data["simulator"] = {key: value for key, value in data["simulator"].items() if value is not None}
    path = folder / name
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path


def straight_on(path: Path) -> None:
    """A roll-out of a simulator file's car, in whatever process this is."""
    from drift_drake.car.car_file import read_simulator_car
    from drift_drake.car.foreign.asked import job_of
    from drift_drake.car.foreign.pool import end_workers, roll_all

    inputs = {"steering": np.zeros((1, 11)), "torque": np.zeros((1, 11))}
    start = np.array([[0.0, 12.0, 0.0, 12.0, 0.0]])
    (got,) = roll_all([job_of(read_simulator_car(path).constants(), 0.01, start, inputs)])
    end_workers()
    assert np.all(np.isfinite(got["r"]))
