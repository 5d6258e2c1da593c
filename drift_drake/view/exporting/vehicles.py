"""Vehicles for other tools: CommonRoad's vehicle parameters (YAML), and a MuJoCo model (MJCF) with four wheels."""

import math
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import yaml

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import static_loads
from drift_drake.car.single_track.motion_with_effects import changed_constants
from drift_drake.common.safe_files import write_text
from drift_drake.view.pictures.car_shape import CarShape

HEAD = """\
# Single-track parameters for CommonRoad's kinematic and dynamic single-track models (KS, ST), written by drift-drake.
# Their tyre has one stiffness per load for both axles: that of the whole car here, {front:.4g} at the front and
# {rear:.4g} at the rear. Length and width are a typical car's of this wheelbase; the height of the centre of gravity
# is unknown.
"""
WHEEL_SHARE = 0.015  # of the car's mass, of each wheel
HEIGHT = 1.5  # of the centre of gravity above ground, in wheel radii: a single-track car has none

MJCF = """\
<mujoco model={name}>
  <!-- Written by drift-drake. MuJoCo's contacts are Coulomb's, not brush tyres: there is no cornering stiffness. -->
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.002" gravity="0 0 -{gravity:.6g}" cone="elliptic"/>
  <worldbody>
    <light pos="0 0 30" dir="0 0 -1" directional="true"/>
    <geom name="ground" type="plane" size="200 200 1" friction="{friction:.6g} 0.005 0.0001" rgba="0.9 0.9 0.88 1"/>
    <body name="car" pos="0 0 {height:.6g}">
      <freejoint name="car"/>
      <inertial pos="{shift:.9g} 0 0" mass="{body_mass:.9g}" diaginertia="{roll:.9g} {pitch:.9g} {yaw:.9g}"/>
      <geom name="shell" type="box" size="{half_length:.6g} {half_width:.6g} {half_height:.6g}" pos="{middle:.6g} 0 0"
            contype="0" conaffinity="0" rgba="0 0.45 0.7 0.6"/>
{wheels}
    </body>
  </worldbody>
  <equality>
    <joint name="steering rack" joint1="front_right_steer" joint2="front_left_steer" polycoef="0 1 0 0 0"/>
    <joint name="rear axle" joint1="rear_right_spin" joint2="rear_left_spin" polycoef="0 1 0 0 0"/>
  </equality>
  <tendon>
    <fixed name="drive"><joint joint="rear_left_spin" coef="0.5"/><joint joint="rear_right_spin" coef="0.5"/></fixed>
  </tendon>
  <actuator>
    <position name="delta" joint="front_left_steer" kp="{steer_gain:.6g}" kv="{steer_damping:.6g}"
              ctrlrange="-{limit:.6g} {limit:.6g}"/>
    <motor name="tau" tendon="drive" gear="{gear:.6g}" ctrlrange="{torque_min:.6g} {torque_max:.6g}"/>
  </actuator>
</mujoco>
"""
WHEEL = """\
      <body name="{name}" pos="{x:.9g} {y:.9g} {z:.9g}">
{steer}        <joint name="{name}_spin" type="hinge" axis="0 1 0" armature="{armature:.9g}"/>
        <inertial pos="0 0 0" mass="{mass:.9g}" diaginertia="{across:.9g} {spin:.9g} {across:.9g}"/>
        <geom name="{name}" type="ellipsoid" size="{radius:.6g} {half_width:.6g} {radius:.6g}" priority="1"
              friction="{friction:.6g} 0.005 0.0001" rgba="0.15 0.15 0.15 1"/>
      </body>"""


def commonroad_data(parameters: VehicleParameters, effects: Effects) -> dict[str, Any]:
    """The parameters by CommonRoad's names (Althoff and Wuersching 2020), constant effects put in."""
    p, shape = changed_constants(parameters.constants(), effects), CarShape.of(parameters)
    stiffness = (p.front_stiffness + p.rear_stiffness) / (p.mass * p.gravity)
    thrust = parameters.torque_max * p.gear_ratio / p.wheel_radius / p.mass
    data = {
        "l": shape.length,
        "w": shape.width,
        "steering": {"min": -parameters.steering_limit, "max": parameters.steering_limit},
        "longitudinal": {"a_max": min(thrust, p.friction * p.gravity)},
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
    p = changed_constants(parameters.constants(), effects)
    front, rear = static_loads(p)
    head = HEAD.format(front=p.front_stiffness / front, rear=p.rear_stiffness / rear)
    write_text(path, head + yaml.safe_dump(commonroad_data(parameters, effects), sort_keys=False))


def _plain(value: Any) -> Any:
    return {name: float(x) for name, x in value.items()} if isinstance(value, dict) else float(value)


def mjcf(parameters: VehicleParameters, effects: Effects, name: str = "car") -> str:
    """The model's XML, constant effects put in; inputs are `delta` [rad] and `tau` [N m] at the engine.

    Mass, centre of gravity and yaw inertia of the whole are the file's; track, width and height are a typical car's.
    """
    p, shape = changed_constants(parameters.constants(), effects), CarShape.of(parameters)
    a, b, radius, half_track = p.front_axle_distance, p.rear_axle_distance, p.wheel_radius, 0.5 * shape.track
    height = HEIGHT * radius
    wheel_mass = WHEEL_SHARE * p.mass
    body_mass = p.mass - 4.0 * wheel_mass
    spin, across = 0.5 * wheel_mass * radius**2, 0.3 * wheel_mass * radius**2
    shift = -2.0 * wheel_mass * (a - b) / body_mass
    wheels_yaw = 2.0 * wheel_mass * (a**2 + b**2 + 2.0 * half_track**2) + 4.0 * across
    yaw = p.yaw_inertia - wheels_yaw - body_mass * shift**2
    parts = []
    for end, x in (("front", a), ("rear", -b)):
        for side, y in (("left", half_track), ("right", -half_track)):
            steered = end == "front"
            joint = f'        <joint name="{end}_{side}_steer" type="hinge" axis="0 0 1" damping="1"/>\n'
            parts.append(WHEEL.format(
                name=f"{end}_{side}", x=x, y=y, z=radius - height, steer=joint if steered else "",
                armature=0.0 if steered else max(0.5 * p.rear_axle_inertia - spin, 0.0), mass=wheel_mass,
                across=across, spin=spin, radius=radius, half_width=0.5 * shape.wheel_width, friction=p.friction,
            ))  # fmt: skip
    steer_gain = 50.0 * p.mass * radius**2
    return MJCF.format(
        name=quoteattr(name), gravity=p.gravity, friction=p.friction, height=height, shift=shift, body_mass=body_mass,
        roll=0.3 * yaw, pitch=0.9 * yaw, yaw=yaw, half_length=0.5 * shape.length, half_width=0.5 * shape.width,
        half_height=0.4 * radius, middle=0.5 * (shape.nose + shape.tail), wheels="\n".join(parts),
        steer_gain=steer_gain, steer_damping=2.0 * math.sqrt(steer_gain * across), limit=parameters.steering_limit,
        gear=p.gear_ratio, torque_min=parameters.torque_min, torque_max=parameters.torque_max,
    )  # fmt: skip


def write_mujoco(parameters: VehicleParameters, effects: Effects, path: Path) -> None:
    write_text(path, mjcf(parameters, effects, path.stem))
