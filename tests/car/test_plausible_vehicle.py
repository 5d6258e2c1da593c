"""Vehicles from 1.6 kg to 40 t are taken; absurd ones are refused by name."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import InvalidVehicleError, Tolerance, VehicleParameters
from drift_drake.car.single_track.motion import motion
from drift_drake.car.vehicle_file import _check_settling as check_settling
from drift_drake.car.vehicle_file import check_effects, check_plausible, effect_range, read_vehicle

P = VehicleParameters()
LORRY = VehicleParameters(
    mass=4e4, yaw_inertia=4e5, front_axle_distance=3.5, rear_axle_distance=2.5, wheel_radius=0.52,
    rear_axle_inertia=400.0, gear_ratio=30.0, friction=0.7, front_stiffness=1.5e6, rear_stiffness=3e6,
    torque_min=-2000.0, torque_max=2600.0,
)  # fmt: skip


def test_small_cars_cars_and_lorries_are_taken() -> None:
    for file in sorted((Path(__file__).parents[2] / "experiments" / "vehicles").glob("*.yaml")):
        read_vehicle(file)
    for vehicle in (P, LORRY):
        check_plausible(vehicle)
        for name, info in CATALOGUE.items():
            for magnitude in info.range_for(vehicle):
                check_effects(make_effects({name: magnitude}), vehicle)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mass", 1e300),
        ("mass", 1e-3),
        ("rear_axle_inertia", 1e-9),
        ("yaw_inertia", 1e9),
        ("front_stiffness", 1.0),
        ("rear_stiffness", 1e12),
        ("torque_max", 1e30),
        ("wheel_radius", 337.0),
        ("gravity", 1e-6),
    ],
)
def test_an_absurd_parameter_is_named(name: str, value: float) -> None:
    with pytest.raises(InvalidVehicleError, match="vehicle: "):
        check_plausible(P.replace(**{name: value}))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("friction_level", -5.0),
        ("mass_error", -2.0),
        ("steering_lag", -0.1),
        ("aero_drag", 1e6),
        ("cg_shift", 1.3),
        ("tyre_relaxation", 1e-9),
        ("drivetrain_inertia_error", -0.99),
        ("gyro_bias", float("nan")),
    ],
)
def test_an_absurd_effect_is_named(name: str, value: float) -> None:
    with pytest.raises(InvalidVehicleError, match=f"effects.{name} is "):
        check_effects(make_effects({name: value}), P)


def refused(vehicle: VehicleParameters) -> str:
    """Why a vehicle is refused; empty where it is not."""
    try:
        check_plausible(vehicle)
    except InvalidVehicleError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("mass", 0.05, 1e5), ("front_axle_distance", 0.01, 20.0), ("rear_axle_distance", 0.01, 20.0),
     ("wheel_radius", 0.003, 3.0), ("gear_ratio", 0.01, 1e3), ("friction", 0.02, 10.0), ("gravity", 0.5, 30.0)],
)  # fmt: skip
def test_sizes_are_taken_up_to_their_ends(name: str, low: float, high: float) -> None:
    """From a model car of 50 g to a vehicle of 100 t; a size at an end may still not fit the other parameters."""
    words = f"{name} is .* no vehicle's is outside {low:g} to {high:g}$"
    for value in (0.999 * low, 1.001 * high):
        assert re.search(words, refused(P.replace(**{name: value})))
    for value in (low, high):
        assert not re.search(words, refused(P.replace(**{name: value})))


@pytest.mark.parametrize(
    ("name", "unit", "low", "high"),
    [("yaw_inertia", 1650.0 * 1.23 * 1.24, 0.02, 50.0), ("rear_axle_inertia", 1650.0 * 0.337**2, 1e-3, 10.0),
     ("front_stiffness", 1650.0 * 9.81, 0.1, 300.0), ("rear_stiffness", 1650.0 * 9.81, 0.1, 300.0),
     ("torque_max", 1650.0 * 9.81 * 0.337 / 10.6, 0.0, 100.0),
     ("torque_min", 1650.0 * 9.81 * 0.337 / 10.6, 0.0, 100.0)],
)  # fmt: skip
def test_inertias_stiffnesses_and_torques_are_judged_by_the_cars_size(
    name: str, unit: float, low: float, high: float
) -> None:
    words = f"{name} is .* no vehicle's is outside {low:g} to {high:g} times$"
    sign = -1.0 if name == "torque_min" else 1.0
    outside = [sign * 1.01 * high * unit] + ([0.99 * low * unit] if low else [])
    for value in outside:
        assert re.search(words, refused(P.replace(**{name: value})))
    inside = [sign * 0.99 * high * unit, 1.01 * max(low, 1e-2) * sign * unit]
    for value in inside:
        assert not re.search(words, refused(P.replace(**{name: value})))


def test_a_vehicle_without_drive_or_without_braking_by_the_engine_is_taken() -> None:
    check_plausible(P.replace(torque_max=0.0))
    check_plausible(P.replace(torque_min=0.0))


@pytest.mark.parametrize("what", ["rim", "turning", "sliding"])
def test_the_rates_at_which_a_car_settles_are_those_of_its_equations(what: str) -> None:
    """Up to 20 000 a second, by numerical derivatives of the motion in straight running at 0.6 sqrt(g wheelbase)."""
    car = P.replace(front_stiffness=2e6, rear_stiffness=3e6, front_coupling=0.4) if what == "rim" else P
    name, at = {"rim": ("rear_axle_inertia", 3), "turning": ("yaw_inertia", 0), "sliding": ("mass", 2)}[what]
    speed, step = 0.6 * math.sqrt(9.81 * 2.47), 1e-7

    def settling(vehicle: VehicleParameters) -> float:
        x = np.array([0.0, speed, 0.0, speed])
        up, down = x.copy(), x.copy()
        up[at], down[at] = x[at] + step, x[at] - step
        rates = [motion(*state, 0.0, 0.0, vehicle.constants())[at] for state in (up, down)]
        return (rates[1] - rates[0]) / (2.0 * step)

    def with_rate(rate: float) -> VehicleParameters:
        """All but a drivetrain's equations have a rate in proportion to one over the inertia."""
        return car.replace(**{name: getattr(car, name) * settling(car) / rate})

    subject = "rear_axle_inertia, the rim settles" if what == "rim" else "yaw_inertia or mass, the body settles"

    def settles_too_fast(vehicle: VehicleParameters) -> bool:
        with pytest.raises(InvalidVehicleError) as error:
            check_settling(vehicle.constants(), "car")
        return subject in str(error.value)

    assert settles_too_fast(with_rate(2.02e4))
    check_settling(with_rate(1.98e4).constants(), "car")


def test_the_sentence_has_how_soon_a_car_settles() -> None:
    """Its sideslip at a rate of both axles' stiffness over mass and speed: at 40 000 a second in 25 microseconds."""
    speed = 0.6 * math.sqrt(9.81 * 2.47)
    light = P.replace(mass=(P.front_stiffness + P.rear_stiffness) / (speed * 4e4))
    with pytest.raises(InvalidVehicleError, match=r"road in 25 microseconds; no vehicle's does in less than 50$"):
        check_settling(light.constants(), "car")


def test_a_tolerance_is_a_standard_deviation_of_ten_at_most() -> None:
    assert not refused(P.replace(tolerance=Tolerance(mass=9.99)))
    words = "vehicle: tolerance.mass is 10.01; give a standard deviation of 10 at most"
    assert refused(P.replace(tolerance=Tolerance(mass=10.01))) == words


def test_ranges_of_effects_are_five_times_the_practical_ones() -> None:
    low, high = CATALOGUE["aero_drag"].range_for(P)
    assert effect_range("aero_drag", P) == pytest.approx((0.0, 5.0 * high))
    low, high = CATALOGUE["gyro_bias"].range_for(P)
    assert effect_range("gyro_bias", P) == pytest.approx((-5.0 * max(high, -low), 5.0 * max(high, -low)))
    assert effect_range("friction_level", P)[0] == -0.95  # a twentieth is left
    assert effect_range("lateral_load_transfer", P)[1] <= 0.95
    assert effect_range("steering_rate_limit", P) == (0.01, 100.0)
    # No file's centre of gravity comes nearer to an axle than a fiftieth of the wheelbase.
    margin = 0.02 * (1.23 + 1.24)
    for shift, taken in ((1.24 - 1.01 * margin, True), (1.24 - 0.99 * margin, False), (0.99 * margin - 1.23, False)):
        if taken:
            check_effects({"cg_shift": min(shift, effect_range("cg_shift", P)[1])}, P)
        else:
            with pytest.raises(InvalidVehicleError, match="cg_shift"):
                check_effects({"cg_shift": shift}, P)
    least = 0.05 * CATALOGUE["tyre_relaxation"].range_for(P)[0]
    check_effects({"tyre_relaxation": least}, P)
    with pytest.raises(InvalidVehicleError, match="give 0 for none"):
        check_effects({"tyre_relaxation": 0.99 * least}, P)


def test_the_ends_of_a_range_are_within_it_and_zero_is_no_effect() -> None:
    """A limit of 0.01 rad/s is the least; of zero there is no limit."""
    for name, q in (("steering_rate_limit", 0.01), ("steering_rate_limit", 100.0), ("friction_level", -0.95)):
        check_effects({name: q}, P)
    check_effects({"steering_rate_limit": 0.0}, P)
    for q in (0.0099, 101.0):
        with pytest.raises(InvalidVehicleError, match="steering_rate_limit"):
            check_effects({"steering_rate_limit": q}, P)


def test_ranges_follow_the_vehicle_s_size() -> None:
    small = P.replace(mass=1.6, wheel_radius=0.03)
    assert effect_range("drivetrain_friction", small)[1] < 1.0
    assert effect_range("drivetrain_friction", LORRY)[1] > effect_range("drivetrain_friction", P)[1]


@pytest.mark.parametrize("text", [".nan", "1e400", "true", "[1]", "1e5"])
def test_effects_in_a_file_are_numbers_in_range(tmp_path: Path, text: str) -> None:
    path = tmp_path / "car.yaml"
    P.to_yaml(path)
    path.write_text(path.read_text() + f"effects: {{aero_drag: {text}}}\n")
    with pytest.raises(InvalidVehicleError, match=r"effects\.aero_drag is"):
        read_vehicle(path)
