"""Vehicle parameters as CommonRoad's vehicle models read them (a YAML of `vehiclemodels.vehicle_parameters`)."""

from pathlib import Path
from typing import Any

import yaml

from drift_drake.pictures.car_shape import CarShape
from drift_drake.safe_files import write_text
from drift_drake.vehicle.bicycle import static_loads
from drift_drake.vehicle.effects import Effects, changed_constants
from drift_drake.vehicle.parameters import VehicleParameters

HEAD = """\
# Single-track parameters for CommonRoad's kinematic and dynamic single-track models (KS, ST), written by drift-drake.
# Their tyre has one stiffness per load for both axles: that of the whole car here, {front:.4g} at the front and
# {rear:.4g} at the rear. Length and width are a typical car's of this wheelbase; the height of the centre of gravity
# is unknown.
"""


def commonroad_data(parameters: VehicleParameters, effects: Effects) -> dict[str, Any]:
    """The parameters by CommonRoad's names (Althoff and Wuersching 2020), constant effects put in."""
    p, shape = changed_constants(parameters.constants(), effects), CarShape.of(parameters)
    stiffness = (p.front_stiffness + p.rear_stiffness) / (p.mass * p.gravity)
    push = parameters.torque_max * p.gear_ratio / p.wheel_radius / p.mass
    data = {
        "l": shape.length,
        "w": shape.width,
        "steering": {"min": -parameters.steering_limit, "max": parameters.steering_limit},
        "longitudinal": {"a_max": min(push, p.friction * p.gravity)},
        "m": p.mass,
        "a": p.front_axle_distance,
        "b": p.rear_axle_distance,
        "I_z": p.yaw_inertia,
        "I_y_w": 0.5 * p.rear_axle_inertia,
        "R_w": p.wheel_radius,
        "h_s": 0.0,
        "tire": {"p_dx1": p.friction, "p_dy1": p.friction, "p_kx1": stiffness, "p_ky1": -stiffness},
    }
    return {name: _plain(value) for name, value in data.items()}


def write_commonroad(parameters: VehicleParameters, effects: Effects, path: Path) -> None:
    """Writes the YAML file."""
    p = changed_constants(parameters.constants(), effects)
    front, rear = static_loads(p)
    head = HEAD.format(front=p.front_stiffness / front, rear=p.rear_stiffness / rear)
    write_text(path, head + yaml.safe_dump(commonroad_data(parameters, effects), sort_keys=False))


def _plain(value: Any) -> Any:
    return {name: float(x) for name, x in value.items()} if isinstance(value, dict) else float(value)
