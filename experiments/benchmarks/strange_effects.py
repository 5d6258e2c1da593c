"""Effects that the catalogue does not have, to test that the diagnosis says `unknown`: forces on the nominal car.

Each family is a change with one magnitude, written on the scalar functions of the vehicle so that both the compiled
plant and a Drake plant use it. None is known to `drift_drake`.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

from drift_drake.car.parameters import Constants
from drift_drake.car.scalar import absolute, cos, exp, jitable, maximum, norm2, select, sin, tanh
from drift_drake.car.single_track.motion import body_wrench, front_contact_velocity, front_slip, rear_slip, static_loads
from drift_drake.car.tyre import tyre_force

RING_FREQUENCY = 19.0  # [rad/s]
RING_DAMPING = 0.12


@dataclasses.dataclass(frozen=True)
class Family:
    """One family: its unit, the range that magnitudes are drawn from (a sign is drawn too), what it does."""

    unit: str
    low: float
    high: float
    signed: bool
    change: str


FAMILIES: dict[str, Family] = {
    "crosswind": Family(
        "N", 250.0, 900.0, True, "a gusting wind along the fixed frame's y, its centre ahead of the car's"
    ),
    "rear_compliance_steer": Family("rad/kN", 0.002, 0.006, True, "the rear wheels steer with their lateral force"),
    "aligning_moment": Family("m", 0.03, 0.09, False, "the front force acts behind the contact point while it grips"),
    "grabbing_brake": Family("N", 300.0, 1200.0, True, "one rear wheel drags while the engine brakes or hardly pulls"),
    "driveline_oscillation": Family("-", 0.15, 0.5, False, "torque at the axle rings at 3 Hz after each change"),
    "slippery_patch": Family("-", 0.15, 0.45, False, "friction is lower on stripes of the ground"),
}


class Strange(NamedTuple):
    """Magnitudes of all families; zero switches one off."""

    crosswind: Any = 0.0
    rear_compliance_steer: Any = 0.0
    aligning_moment: Any = 0.0
    grabbing_brake: Any = 0.0
    driveline_oscillation: Any = 0.0
    slippery_patch: Any = 0.0
    tyre_curve: Any = 0.0  # no family of the blind check: a model discrepancy, from 0 to 1 (`rational_force`)


def make_strange(magnitudes: Mapping[str, float]) -> Strange:
    """All families' magnitudes as floats, zero where none is given."""
    return Strange(**{name: float(magnitudes.get(name, 0.0)) for name in Strange._fields})


@jitable
def ground_friction(x: Any, y: Any, q: Strange) -> Any:
    """Factor of friction at a place [m]: stripes of 6 m each 20 m along x + y / 2, with soft edges."""
    phase = sin(0.314159 * (x + 0.5 * y))
    return 1.0 - q.slippery_patch / (1.0 + exp(-(phase - 0.6) / 0.05))


@jitable
def rational_force(sigma_x: Any, sigma_y: Any, stiffness: Any, peak: Any) -> tuple[Any, Any]:
    """Axle force with the brush's stiffness and peak [N] that comes to its peak sooner and falls off beyond it."""
    z = stiffness * norm2(sigma_x, sigma_y) / peak
    secant = stiffness / (1.0 + 0.25 * z * z)
    return secant * sigma_x, -secant * sigma_y


@jitable
def strange_wrench(
    t: Any, r: Any, v: Any, beta: Any, omega_r: Any, x: Any, y: Any, psi: Any, delta: Any, tau: Any, p: Constants,
    q: Strange,
) -> tuple[Any, Any, Any]:  # fmt: skip
    """Further force (F_x, F_y) [N] and yaw moment [N m] on the body."""
    gust = q.crosswind * (1.0 + 0.4 * sin(0.9 * t))
    f_x, f_y = gust * sin(psi), gust * cos(psi)
    m_z = 0.3 * f_y
    f_zf, f_zr = static_loads(p)
    # Rear compliance steer: the rear slip moves by the steered angle, to first order in it.
    sigma_x, sigma_y = rear_slip(r, v, beta, omega_r, p.rear_axle_distance)
    plain_x, plain_y = tyre_force(sigma_x, sigma_y, p.rear_stiffness, p.friction * f_zr, p.tyre)
    steered = q.rear_compliance_steer * plain_y / 1000.0
    moved_x, moved_y = tyre_force(sigma_x, sigma_y - steered, p.rear_stiffness, p.friction * f_zr, p.tyre)
    f_x, f_y = f_x + moved_x - plain_x, f_y + moved_y - plain_y
    m_z = m_z - p.rear_axle_distance * (moved_y - plain_y)
    # Aligning moment: a pneumatic trail that vanishes as the front slides.
    v_x, v_y = front_contact_velocity(r, v, beta, delta, p.front_axle_distance)
    _, sigma_f = front_slip(v_x, v_y, omega_r, p.front_coupling)
    _, f_yf = tyre_force(0.0 * v_x, sigma_f, p.front_stiffness, p.friction * f_zf, p.tyre)
    full = 3.0 * p.friction * f_zf / p.front_stiffness
    grip = maximum(1.0 - absolute(sigma_f) / full, 0.0)
    m_z = m_z - q.aligning_moment * f_yf * grip
    # A dragging rear wheel, 0.75 m off the centre line.
    drag = absolute(q.grabbing_brake) / (1.0 + exp((tau - 20.0) / 5.0)) * tanh(v)
    f_x = f_x - drag
    m_z = m_z + select(0.0, q.grabbing_brake, 0.75, -0.75) * drag
    # Slippery ground: what the tyres lack there, but for the wheel's own motion.
    slippery = p.friction * ground_friction(x, y, q)
    _, low_f = tyre_force(0.0 * v_x, sigma_f, p.front_stiffness, slippery * f_zf, p.tyre)
    low_x, low_y = tyre_force(sigma_x, sigma_y, p.rear_stiffness, slippery * f_zr, p.tyre)
    lack_x, lack_y, lack_m = body_wrench(
        delta, 0.0, low_f - f_yf, low_x - plain_x, low_y - plain_y, p.front_axle_distance, p.rear_axle_distance
    )
    # Tyres of another shape: a part of their force follows another curve.
    _, other_f = rational_force(0.0 * v_x, sigma_f, p.front_stiffness, p.friction * f_zf)
    other_x, other_y = rational_force(sigma_x, sigma_y, p.rear_stiffness, p.friction * f_zr)
    curve_x, curve_y, curve_m = body_wrench(
        delta, 0.0, q.tyre_curve * (other_f - f_yf), q.tyre_curve * (other_x - plain_x),
        q.tyre_curve * (other_y - plain_y), p.front_axle_distance, p.rear_axle_distance,
    )  # fmt: skip
    return f_x + lack_x + curve_x, f_y + lack_y + curve_y, m_z + lack_m + curve_m


@jitable
def ring_rates(ring: Any, ring_rate: Any, tau: Any) -> tuple[Any, Any]:
    """Rates of the driveline's oscillator, whose `ring` follows the torque tau with overshoot."""
    return ring_rate, RING_FREQUENCY * RING_FREQUENCY * (tau - ring) - 2.0 * RING_DAMPING * RING_FREQUENCY * ring_rate


@jitable
def rung_torque(tau: Any, ring: Any, q: Strange) -> Any:
    """Torque that reaches the axle: part of it through the oscillator."""
    return tau + q.driveline_oscillation * (ring - tau)
