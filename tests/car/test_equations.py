"""One door to the equations of every kind of car: the same as each car's plant has, compiled and not."""

import numpy as np
import pytest

from drift_drake.car import equations
from drift_drake.car.actuated import without_actuators
from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.car.compilation import compiled
from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.catalogue import CATALOGUE, OWN
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.car.single_track import equations as single_track
from drift_drake.car.single_track.plant import VehiclePlant
from drift_drake.common.arrays import Array

EFFECTS = Effects(mass_error=0.1, cg_shift=0.05, aero_drag=0.8, road_grade=0.03, tyre_relaxation=0.4)
STATE, COMMAND, WRENCH = (0.4, 11.0, -0.2, 11.8), (0.12, 180.0), np.array([300.0, -200.0, 150.0])
HEADING = 0.7
KINDS = [(VehicleParameters(), VehiclePlant, 2), (CARS["coupe"], EquationsPlant, 0),
         (BrushParameters(), EquationsPlant, 0)]  # fmt: skip


@compiled
def _rates(z: Array, delta: float, torque: float, constants: tuple[float, ...], effects: Effects, wrench: Array,
           out: Array, decays: Array) -> float:  # fmt: skip
    equations.settle(z, delta, torque, constants, effects)
    equations.rates(z, (delta, torque), (constants, effects, wrench), out)
    equations.decays(z, constants, effects, decays)
    return equations.fastest(z, constants, effects)


def settled(car: CarParameters) -> Array:
    z = np.zeros(equations.size_of(car.constants()))
    z[:4], z[4] = STATE, HEADING
    equations.settle(z, *COMMAND, car.constants(), EFFECTS)
    return z


@pytest.mark.parametrize(("car", "plant", "commanded"), KINDS)
def test_rates_are_the_plants(car: CarParameters, plant: type, commanded: int) -> None:
    """Internal states too, but for those of the commands where they are worked out ahead."""
    system = plant(car, EFFECTS)
    context = system.CreateDefaultContext()
    system.set_initial(context, [*STATE, 0.0, 0.0], pose=(0.0, 0.0, HEADING), actuation=COMMAND)
    system.GetInputPort("actuation").FixValue(context, COMMAND)
    system.GetInputPort("disturbance").FixValue(context, WRENCH)
    expected = system.EvalTimeDerivatives(context).CopyToVector()
    z = settled(car)
    out = np.zeros(len(z))
    equations.rates(z, COMMAND, (car.constants(), EFFECTS, WRENCH), out)
    np.testing.assert_allclose(out[:4], expected[:4], rtol=1e-9)
    assert out[4] == expected[9]
    np.testing.assert_allclose(out[5:], expected[10 + commanded :], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("car", "plant", "commanded"), KINDS)
def test_compiled_code_finds_the_car_by_its_numbers(car: CarParameters, plant: type, commanded: int) -> None:  # noqa: ARG001
    z = settled(car)
    again, out, decays = z.copy(), np.zeros(len(z)), np.zeros(len(z))
    again[5:] = 0.0
    fastest = _rates(again, *COMMAND, car.constants(), EFFECTS, WRENCH, out, decays)
    np.testing.assert_allclose(again, z, rtol=1e-9, atol=1e-12)
    expected, plain = np.zeros(len(z)), np.zeros(len(z))
    equations.rates(z, COMMAND, (car.constants(), EFFECTS, WRENCH), expected)
    equations.decays(z, car.constants(), EFFECTS, plain)
    np.testing.assert_allclose(out, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(decays, plain)
    assert fastest == pytest.approx(equations.fastest(z, car.constants(), EFFECTS))


@pytest.mark.parametrize(("car", "plant", "commanded"), KINDS)
def test_the_fastest_rate_bounds_what_the_equations_do(car: CarParameters, plant: type, commanded: int) -> None:  # noqa: ARG001
    """By the eigenvalues of the rates' differences: a step that it sets is within Runge-Kutta's stability (2.5)."""
    z, constants = settled(car), car.constants()
    base, jacobian = np.zeros(len(z)), np.zeros((len(z), len(z)))
    equations.rates(z, COMMAND, (constants, EFFECTS, np.zeros(3)), base)
    for j in range(len(z)):
        moved, out = z.copy(), np.zeros(len(z))
        moved[j] += 1e-6
        equations.rates(moved, COMMAND, (constants, EFFECTS, np.zeros(3)), out)
        jacobian[:, j] = (out - base) / 1e-6
    largest = np.abs(np.linalg.eigvals(jacobian)).max()
    assert largest < 1.6 * equations.fastest(z, constants, EFFECTS)


@pytest.mark.parametrize(("car", "plant", "commanded"), KINDS)
def test_effects_that_change_numbers_are_folded_into_them(car: CarParameters, plant: type, commanded: int) -> None:  # noqa: ARG001
    constants, rest = equations.folded_into(car.constants(), EFFECTS)
    assert rest.mass_error == rest.cg_shift == 0.0
    assert rest.road_grade == EFFECTS.road_grade
    z, out, expected = settled(car), np.zeros(50), np.zeros(50)
    equations.rates(z, COMMAND, (constants, rest, WRENCH), out)
    equations.rates(z, COMMAND, (car.constants(), EFFECTS, WRENCH), expected)
    np.testing.assert_allclose(out, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", [n for n in OWN if n not in single_track.REMEMBERING])
def test_internal_states_move_a_car_only_by_the_effects_that_remember(name: str) -> None:
    car, (_, high) = VehicleParameters(), CATALOGUE[name].range_for(VehicleParameters())
    effects = without_actuators(Effects(**{name: high}))
    z = np.zeros((2, equations.size_of(car.constants())))
    z[:, :4], z[1, 5:] = STATE, 0.3
    out = np.zeros_like(z)
    for state, rates in zip(z, out, strict=True):
        equations.rates(state, COMMAND, (car.constants(), effects, WRENCH), rates)
    np.testing.assert_array_equal(out[0, :5], out[1, :5])
