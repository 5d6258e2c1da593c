"""The vehicle that an answer corrects."""

from drift_drake.car.effects.magnitudes import Effects, combined, make_effects
from drift_drake.car.equations import check_supported
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.parameters import RELATIVE, CarParameters, SomeCar, VehicleParameters
from drift_drake.gap.diagnosis.answers.answer import Answer, InvalidAnswerError


def corrected_vehicle(
    vehicle: SomeCar,
    answer: Answer,
    tolerances: bool = True,
    own: Effects = Effects(),
) -> tuple[SomeCar, Effects]:
    """The vehicle with the answer's causes added, and what comes along with them (`details["with"]`).

    Args:
        vehicle: that was diagnosed, without effects; answer: of the diagnosis;
        tolerances: whether the deviations within tolerance that were found with them are applied too;
        own: effects that the vehicle had before.

    Raises:
        InvalidAnswerError: the answer has deviations of a single-track vehicle file, and the vehicle is another;
        InvalidVehicleError: of effects that the car cannot have.

    Examples:
        >>> corrected, effects = corrected_vehicle(car, read_answer("answer.json"))
        >>> effects.steering_lag
        0.1
    """
    magnitudes = {name: answer.magnitudes[name].estimate for name in answer.causes}
    for name, value in answer.details.get("with", {}).items() if answer.causes else ():
        magnitudes[name] = magnitudes.get(name, 0.0) + float(value)
    if tolerances and any(answer.tolerances.values()):
        check_single_track(vehicle, answer)
        car, n, t = vehicle.single_track(), answer.tolerances, vehicle.tolerance
        changes = {name: getattr(car, name) * (1.0 + n.get(name, 0.0) * getattr(t, name)) for name in RELATIVE}
        shift = n.get("front_axle_distance", 0.0) * t.front_axle_distance
        changes["front_axle_distance"] = car.front_axle_distance + shift
        changes["rear_axle_distance"] = car.rear_axle_distance - shift
        changes["gear_ratio"] = car.gear_ratio * (1.0 + n.get("torque", 0.0) * t.torque)
        offset = n.get("steering_offset", 0.0) * t.steering_offset
        if offset != 0.0:
            magnitudes["steering_offset"] = magnitudes.get("steering_offset", 0.0) + offset
        vehicle = vehicle.replace(**changes)
    effects = combined(own, make_effects(magnitudes))
    if not isinstance(vehicle, SimulatorCar):
        check_supported(vehicle.constants(), effects, answer.case)
    return vehicle, effects


def check_single_track(vehicle: CarParameters, answer: Answer) -> None:
    """Raises InvalidAnswerError where an answer's deviations cannot be put on the vehicle: of a vehicle file."""
    if not isinstance(vehicle, VehicleParameters):
        raise InvalidAnswerError(
            f"{answer.case} was diagnosed with a single-track vehicle file, from which its deviations within "
            "tolerance are; give that file, or --no-tolerances"
        )
