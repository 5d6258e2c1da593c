"""A MuJoCo car as a car that is stepped: springs, a steering rack, and wheels that touch the road by contact alone.

Cars are drawn one by one about the coupe that the controllers take them for. Needs `pip install mujoco`.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from drift_drake.car.foreign.stepped_plant import WorldMotion
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array

STEP = 0.001  # [s]
SETTLING = 2.0  # [s] on its springs, after which it is put into its start
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
WHEEL_MASS, HUB_MASS = 20.0, 5.0  # [kg]
HOLDS = mujoco.mjtState.mjSTATE_INTEGRATION  # all that the next step depends on


class MujocoParameters(NamedTuple):
    """SI."""

    mass: float
    yaw_inertia: float
    front_axle_distance: float
    rear_axle_distance: float
    half_track: float
    cg_height: float
    wheel_radius: float
    rear_axle_inertia: float
    friction: float
    stick: float  # of the contacts: the stiffer, the less they creep
    front_spring: float  # [N/m]
    rear_spring: float


COUPE = VehicleParameters()
DRAWN = {"mass": 0.05, "yaw_inertia": 0.08, "cg_height": 0.08, "friction": 0.05, "stick": 0.2, "front_spring": 0.15,
         "rear_spring": 0.15}  # fmt: skip
"""Relative standard deviations."""
TYPICAL = MujocoParameters(
    COUPE.mass, COUPE.yaw_inertia, COUPE.front_axle_distance, COUPE.rear_axle_distance, 0.78, 0.48, COUPE.wheel_radius,
    COUPE.rear_axle_inertia, 1.0, 0.006, 4e4, 4e4,
)  # fmt: skip

XML = """
<mujoco model="car">
  <option timestep="{step}" integrator="implicitfast" cone="elliptic" impratio="{p.stick}"/>
  <default>
    <geom condim="3" friction="{p.friction} 0 0" solref="0.01 1" solimp="0.95 0.99 0.001"/>
  </default>
  <worldbody>
    <geom name="road" type="plane" size="0 0 1"/>
    <body name="chassis" pos="0 0 {p.wheel_radius}">
      <freejoint/>
      <inertial pos="0 0 {rise}" mass="{sprung}" diaginertia="500 {pitch} {yaw}"/>
      <site name="cg" pos="0 0 {rise}"/>
      {corners}
    </body>
  </worldbody>
  <actuator>
    <position joint="front_left_steer" kp="60000" kv="900"/>
    <position joint="front_right_steer" kp="60000" kv="900"/>
    <motor joint="rear_left_spin"/>
    <motor joint="rear_right_spin"/>
    <general site="cg" gear="1 0 0 0 0 0"/>
    <general site="cg" gear="0 1 0 0 0 0"/>
    <general site="cg" gear="0 0 0 0 0 1"/>
  </actuator>
  <sensor><framepos objtype="site" objname="cg"/><framelinvel objtype="site" objname="cg"/></sensor>
</mujoco>
"""
CORNER = """
      <body name="{name}" pos="{x} {y} 0">
        <joint name="{name}_spring" type="slide" axis="0 0 1" stiffness="{stiffness}" damping="{damping}"
               springref="{sag}"/>
        <inertial pos="0 0 0" mass="{hub}" diaginertia="0.1 0.1 0.1"/>
        {steer}
        <body name="{name}_wheel">
          <joint name="{name}_spin" type="hinge" axis="0 1 0" armature="{armature}"/>
          <inertial pos="0 0 0" mass="{wheel}" diaginertia="0.7 1.2 0.7"/>
          <geom type="ellipsoid" size="{radius} 0.08 {radius}"/>
        </body>
      </body>"""


def model_of(p: MujocoParameters) -> mujoco.MjModel:
    """The model of a car."""
    corners, load = [], p.mass * COUPE.gravity / (p.front_axle_distance + p.rear_axle_distance)
    for name in WHEELS:
        front = name.startswith("front")
        stiffness = p.front_spring if front else p.rear_spring
        corners.append(CORNER.format(
            name=name, x=p.front_axle_distance if front else -p.rear_axle_distance, stiffness=stiffness,
            y=p.half_track if name.endswith("left") else -p.half_track, radius=p.wheel_radius,
            damping=0.25 * math.sqrt(stiffness * p.mass), hub=HUB_MASS, wheel=WHEEL_MASS,
            armature=0.1 if front else 0.5 * p.rear_axle_inertia - 1.2,
            sag=-0.5 * load * (p.rear_axle_distance if front else p.front_axle_distance) / stiffness,
            steer=f'<joint name="{name}_steer" axis="0 0 1" damping="40"/>' if front else "",
        ))  # fmt: skip
    unsprung = 4.0 * (HUB_MASS + WHEEL_MASS)
    square = 0.5 * (p.front_axle_distance**2 + p.rear_axle_distance**2) + p.half_track**2
    return mujoco.MjModel.from_xml_string(XML.format(
        p=p, step=STEP, rise=p.cg_height - p.wheel_radius, sprung=p.mass - unsprung, pitch=0.9 * p.yaw_inertia,
        yaw=p.yaw_inertia - unsprung * square, corners="".join(corners),
    ))  # fmt: skip


class MujocoCar:
    """A `SteppedCar`; the `MjData` is scratch, each call begins from the state that it is given."""

    def __init__(self, p: MujocoParameters) -> None:
        self._p, self._model = p, model_of(p)
        self._data = mujoco.MjData(self._model)
        self._spins = [self._model.joint(f"{name}_spin").dofadr[0] for name in WHEELS]
        self._steers = [self._model.joint(f"{name}_steer").qposadr[0] for name in WHEELS[:2]]
        size = mujoco.mj_stateSize(self._model, HOLDS)
        self.state_names = tuple(f"mujoco_{i}" for i in range(size))
        for _ in range(round(SETTLING / STEP)):
            mujoco.mj_step(self._model, self._data)
        self._rest = self._state()

    def _state(self) -> Array:
        found = np.empty(mujoco.mj_stateSize(self._model, HOLDS))
        mujoco.mj_getState(self._model, self._data, found, HOLDS)
        return found

    def start(self, state: Sequence[float], pose: Sequence[float], actuation: Sequence[float]) -> Array:
        (r, v, beta, omega_r), (x, y, psi), data = state, pose, self._data
        mujoco.mj_setState(self._model, data, self._rest, HOLDS)
        data.time = 0.0
        data.qpos[:2], data.qpos[3:7] = (x, y), (math.cos(0.5 * psi), 0.0, 0.0, math.sin(0.5 * psi))
        data.qvel[:] = 0.0
        data.qvel[:2], data.qvel[5] = (v * math.cos(psi + beta), v * math.sin(psi + beta)), r
        rolling = v * math.cos(beta) / self._p.wheel_radius
        for name, spin in zip(WHEELS, self._spins, strict=True):
            data.qvel[spin] = omega_r / self._p.wheel_radius if name.startswith("rear") else rolling
        data.qpos[self._steers] = data.ctrl[:2] = actuation[0]
        return self._state()

    def step(self, own: Array, actuation: Array, wrench: Array, duration: float) -> Array:
        data = self._data
        mujoco.mj_setState(self._model, data, np.ascontiguousarray(own), HOLDS)
        axle = 0.5 * float(actuation[1]) * COUPE.gear_ratio
        data.ctrl[:] = [actuation[0], actuation[0], axle, axle, *wrench]
        mujoco.mj_step(self._model, data, max(1, round(duration / STEP)))
        return self._state()

    def motion(self, own: Array) -> WorldMotion:
        # Positions and velocities of the chassis, which come first; its origin lies below the centre of gravity.
        q, v = own[1:8], own[1 + self._model.nq : 1 + self._model.nq + self._model.nv]
        w, i, j, k = q[3:7]
        psi = math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))
        up = np.array([2.0 * (i * k + w * j), 2.0 * (j * k - w * i), 1.0 - 2.0 * (i * i + j * j)])
        lever = (self._p.cg_height - self._p.wheel_radius) * up
        turn = np.empty(3)
        mujoco.mju_rotVecQuat(turn, v[3:6], q[3:7])  # angular velocities are the body's
        moved = v[:3] + np.cross(turn, lever)
        rear = 0.5 * self._p.wheel_radius * (v[self._spins[2]] + v[self._spins[3]])
        return WorldMotion(q[0] + lever[0], q[1] + lever[1], psi, turn[2], moved[0], moved[1], rear)


def draw_mujoco(index: int, seed: int, friction: float = 1.0) -> MujocoCar:
    """Car `index` of a draw, the same for the same arguments; friction: factor of its contacts'."""
    generator = np.random.default_rng([seed, 31, index])
    drawn = {name: getattr(TYPICAL, name) * (1.0 + generator.normal() * deviation) for name, deviation in DRAWN.items()}
    shift = 0.03 * generator.normal()
    drawn |= {"front_axle_distance": TYPICAL.front_axle_distance + shift,
              "rear_axle_distance": TYPICAL.rear_axle_distance - shift}  # fmt: skip
    car = TYPICAL._replace(**drawn)
    return MujocoCar(car._replace(friction=friction * car.friction))
