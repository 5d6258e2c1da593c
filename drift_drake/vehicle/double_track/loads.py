"""Wheel loads: static, shifted along the car by its acceleration, and across it by roll and lateral force."""

from typing import Any

from drift_drake.vehicle.double_track.constants import DoubleTrackConstants
from drift_drake.vehicle.scalar import clip, jitable

LEAST_LOAD_SHARE = 0.02  # of an axle's load that its unloaded wheel keeps, and of the weight that an axle keeps


@jitable
def sprung_mass(p: DoubleTrackConstants) -> Any:
    """Mass on the springs [kg]."""
    return p.mass - p.front_unsprung_mass - p.rear_unsprung_mass


@jitable
def roll_arm_moment(p: DoubleTrackConstants) -> Any:
    """Sprung mass times the height of its centre above the roll axis [kg m]; unsprung masses are at wheel centres.

    The sprung mass is taken to lie lengthwise where the whole car's centre of gravity is.
    """
    unsprung = p.front_unsprung_mass + p.rear_unsprung_mass
    wheelbase = p.front_axle_distance + p.rear_axle_distance
    axis = (p.front_roll_center * p.rear_axle_distance + p.rear_roll_center * p.front_axle_distance) / wheelbase
    return p.mass * p.cg_height - unsprung * p.wheel_radius - sprung_mass(p) * axis


@jitable
def axle_loads(p: DoubleTrackConstants, a_x: Any) -> tuple[Any, Any]:
    """Axle loads (F_zf, F_zr) [N] at the longitudinal ground force over mass a_x [m/s^2]; their sum is the weight."""
    wheelbase = p.front_axle_distance + p.rear_axle_distance
    weight = p.mass * p.gravity
    least = LEAST_LOAD_SHARE * weight
    rear = weight * p.front_axle_distance / wheelbase + p.mass * a_x * p.cg_height / wheelbase
    rear = clip(rear, least, weight - least)
    return weight - rear, rear


@jitable
def axle_transfer(p: DoubleTrackConstants, roll: Any, roll_rate: Any, a_y: Any) -> tuple[Any, Any]:
    """Load [N] that moves from the left to the right wheel, front and rear.

    Springs, stabilisers and dampers carry the roll moment; the roll centres take the sprung mass's side force and the
    unsprung masses their own without the body rolling.

    Args:
        p: the car; roll [rad], roll_rate [rad/s]: positive to the right side down; a_y: ground force over mass [m/s^2].
    """
    wheelbase = p.front_axle_distance + p.rear_axle_distance
    damping = p.roll_damping / (p.front_roll_stiffness + p.rear_roll_stiffness) * roll_rate
    sprung = sprung_mass(p) / wheelbase
    front_direct = sprung * p.rear_axle_distance * p.front_roll_center + p.front_unsprung_mass * p.wheel_radius
    rear_direct = sprung * p.front_axle_distance * p.rear_roll_center + p.rear_unsprung_mass * p.wheel_radius
    front = p.front_roll_stiffness * (roll + damping) + front_direct * a_y
    rear = p.rear_roll_stiffness * (roll + damping) + rear_direct * a_y
    return front / p.front_track, rear / p.rear_track


@jitable
def wheel_loads(p: DoubleTrackConstants, roll: Any, roll_rate: Any, a_x: Any, a_y: Any) -> tuple[Any, Any, Any, Any]:
    """Loads [N] of the wheels (front left, front right, rear left, rear right); their sum is the weight.

    A wheel that would lift keeps a small share of its axle's load.
    """
    front, rear = axle_loads(p, a_x)
    front_transfer, rear_transfer = axle_transfer(p, roll, roll_rate, a_y)
    largest = 0.5 - LEAST_LOAD_SHARE
    front_transfer = clip(front_transfer, -largest * front, largest * front)
    rear_transfer = clip(rear_transfer, -largest * rear, largest * rear)
    return (0.5 * front - front_transfer, 0.5 * front + front_transfer,
            0.5 * rear - rear_transfer, 0.5 * rear + rear_transfer)  # fmt: skip
