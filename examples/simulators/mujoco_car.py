"""A simulator as one may have it in MuJoCo: a car with springs, a steering rack, and wheels that touch the road.

See mujoco_car.yaml. All roll-outs of a call are stepped by MuJoCo's own threads (`mujoco.rollout`).
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
STEP = 0.002  # [s]
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")

XML = """
<mujoco model="car">
  <option timestep="0.002" integrator="implicitfast" cone="elliptic" impratio="{stick}"/>
  <default>
    <geom condim="3" friction="{mu} 0 0" solref="0.01 1" solimp="0.95 0.99 0.001"/>
    <joint damping="0"/>
  </default>
  <worldbody>
    <geom name="road" type="plane" size="0 0 1" friction="{mu} 0 0"/>
    <body name="chassis" pos="0 0 {z}">
      <freejoint/>
      <inertial pos="0 0 {rise}" mass="{sprung}" diaginertia="500 {pitch} {yaw}"/>
      <site name="cg" pos="0 0 {rise}"/>
      {corners}
    </body>
  </worldbody>
  <actuator>
    {actuators}
    <general name="F_x" site="cg" gear="1 0 0 0 0 0"/>
    <general name="F_y" site="cg" gear="0 1 0 0 0 0"/>
    <general name="M_z" site="cg" gear="0 0 0 0 0 1"/>
  </actuator>
  <sensor>
    <gyro site="cg"/><velocimeter site="cg"/>
    <jointvel joint="rear_left_spin"/><jointvel joint="rear_right_spin"/>
  </sensor>
</mujoco>
"""
CORNER = """
      <body name="{name}" pos="{x} {y} 0">
        <joint name="{name}_spring" type="slide" axis="0 0 1" stiffness="{stiffness}" damping="{damping}"
               springref="{sag}"/>
        {steer}
        <body name="{name}_wheel">
          <joint name="{name}_spin" type="hinge" axis="0 1 0" armature="{armature}"/>
          <inertial pos="0 0 0" mass="20" diaginertia="0.7 1.2 0.7"/>
          <geom type="ellipsoid" size="{R} 0.08 {R}"/>
        </body>
      </body>"""
HUB = '<inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.1"/>'
STEER = HUB + '<joint name="{name}_steer" axis="0 0 1" damping="40"/>'


@lru_cache(maxsize=2)
def model_of(parameters: tuple[tuple[str, float], ...]) -> tuple[mujoco.MjModel, Numbers]:
    """The model with these parameters, and a state at rest on its springs."""
    p = dict(parameters)
    corners, load = [], p["mass"] * 9.81 / (p["a"] + p["b"])
    for name in WHEELS:
        front = name.startswith("front")
        stiffness = p["front_spring"] if front else p["rear_spring"]
        corners.append(CORNER.format(
            name=name, x=p["a"] if front else -p["b"], y=0.78 if name.endswith("left") else -0.78, R=p["R"],
            stiffness=stiffness, damping=0.25 * np.sqrt(stiffness * p["mass"]), armature=0.1 if front else 6.0,
            sag=-0.5 * load * (p["b"] if front else p["a"]) / stiffness,
            steer=STEER.format(name=name) if front else HUB,
        ))  # fmt: skip
    actuators = [f'<position joint="{name}_steer" kp="60000" kv="900"/>' for name in WHEELS[:2]]
    actuators += [f'<motor joint="{name}_spin"/>' for name in WHEELS[2:]]
    model = mujoco.MjModel.from_xml_string(XML.format(
        mu=p["mu"], stick=p["stick"], z=p["R"], rise=p["h"] - p["R"], sprung=p["mass"] - 100.0, pitch=0.9 * p["Izz"],
        yaw=p["Izz"] - 100.0 * (0.5 * (p["a"] ** 2 + p["b"] ** 2) + 0.78**2), corners="".join(corners),
        actuators="".join(actuators),
    ))  # fmt: skip
    data = mujoco.MjData(model)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    data.qpos[:2], data.qvel[:], data.time = 0.0, 0.0, 0.0
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return model, state


def follow(velocity: Numbers, quaternion: Numbers, measured: Sequence[Numbers], rise: float) -> None:
    """Gives the body [n] the measured v_x, v_y [m/s] at its centre of gravity and yaw rate [rad/s], in place."""
    w, x, y, z = quaternion.T
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    v_x, v_y = measured[0] - velocity[:, 4] * rise, measured[1] + velocity[:, 3] * rise
    velocity[:, 0], velocity[:, 1] = v_x * np.cos(yaw) - v_y * np.sin(yaw), v_x * np.sin(yaw) + v_y * np.cos(yaw)
    velocity[:, 5] = measured[2]


def simulate(
    start: Mapping[str, Numbers], inputs: Mapping[str, Numbers], dt: float, parameters: Mapping[str, float]
) -> dict[str, Numbers]:
    """Roll-outs: start values yaw_rate, v_x, v_y, omega [n]; inputs steer [rad], torque [N m at the axle], F_x, F_y,
    M_z [n, rows]; returns yaw_rate, v_x, v_y, omega [rad/s] and heading [rad], each [n, rows].

    Up to the first row with lead_in 0, the body follows the measured led_v_x, led_v_y and led_r, so that springs and
    wheels settle under that motion.
    """
    model, rest = model_of(tuple(parameters.items()))
    count, rows = inputs["steer"].shape
    fine = max(round(dt / STEP), 1)
    model.opt.timestep = dt / fine
    state = np.tile(rest, (count, 1))
    # Full physics: time, then positions, then velocities.
    velocity = state[:, 1 + model.nq : 1 + model.nq + model.nv]
    velocity[:, 0], velocity[:, 1], velocity[:, 5] = start["v_x"], start["v_y"], start["yaw_rate"]
    for name in WHEELS:
        at = model.joint(f"{name}_spin").dofadr[0]
        velocity[:, at] = start["omega"] if name.startswith("rear") else start["v_x"] / parameters["R"]
    for name in WHEELS[:2]:
        state[:, 1 + model.joint(f"{name}_steer").qposadr[0]] = inputs["steer"][:, 0]
    at = (np.arange((rows - 1) * fine) + 0.5) / fine
    low = at.astype(int)

    def between(values: Numbers) -> Numbers:
        return np.asarray(values[:, low] + (at - low) * (values[:, low + 1] - values[:, low]))

    steer, half = between(inputs["steer"]), 0.5 * between(inputs["torque"])
    control = np.stack([steer, steer, half, half, *(between(inputs[name]) for name in ("F_x", "F_y", "M_z"))], axis=-1)
    led, parts, data = int(np.argmin(inputs["lead_in"][0])), [], mujoco.MjData(model)
    for row in range(led + 1):  # row by row while it is led in, then to the end
        if led:
            follow(velocity, state[:, 4:8], [inputs[name][:, row] for name in ("led_v_x", "led_v_y", "led_r")],
                   parameters["h"] - parameters["R"])  # fmt: skip
        end = (row + 1) * fine if row < led else control.shape[1]
        states, sensors = rollout.rollout(model, data, initial_state=state, control=control[:, row * fine : end])
        state[:] = states[:, -1]
        parts.append(sensors)
    sensed = np.concatenate(parts, axis=1)[:, fine - 1 :: fine]  # a step's sensors are those of its begin
    yaw, v_x, v_y = (np.concatenate([np.asarray(start[name])[:, None], sensed[..., i]], axis=1)
                     for name, i in (("yaw_rate", 2), ("v_x", 3), ("v_y", 4)))  # fmt: skip
    omega = np.concatenate([np.asarray(start["omega"])[:, None], 0.5 * (sensed[..., 6] + sensed[..., 7])], axis=1)
    return {"yaw_rate": yaw, "v_x": v_x, "v_y": v_y, "omega": omega}
