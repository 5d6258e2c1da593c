"""VehiclePlant with Drake's other scalars: gradients and expressions."""

import numpy as np
import pytest
from plant_bench import ACTUATION, MANY_EFFECTS, PARAMETERS, STATE, prepared, s_bend
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.symbolic import Expression, MakeVectorVariable

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import Constants
from drift_drake.car.single_track.motion import linearize
from drift_drake.car.single_track.plant import (
    VehiclePlant,
)


@pytest.mark.parametrize("effects", [Effects(), MANY_EFFECTS])
def test_drakes_gradients_are_the_analytic_jacobians_or_differences(effects):
    plant = VehiclePlant(PARAMETERS, effects, s_bend())
    context = prepared(plant, s=30.0)
    gradient_plant = plant.ToAutoDiffXd()
    gradient_context = gradient_plant.CreateDefaultContext()
    gradient_context.SetTimeStateAndParametersFrom(context)
    x = context.get_continuous_state_vector().CopyToVector()
    point = InitializeAutoDiff(np.concatenate([x, ACTUATION])).ravel()
    gradient_context.SetContinuousState(point[: len(x)])
    gradient_plant.GetInputPort("actuation").FixValue(gradient_context, point[len(x) :])
    rates = gradient_plant.EvalTimeDerivatives(gradient_context).CopyToVector()
    value, gradient = ExtractValue(rates).ravel(), ExtractGradient(rates)
    np.testing.assert_allclose(value, plant.EvalTimeDerivatives(context).CopyToVector(), rtol=1e-12, atol=1e-12)
    if not effects.friction_level:
        _, a, b = linearize(np.array(STATE), np.array(ACTUATION), s_bend().curvature(30.0), PARAMETERS.constants())
        np.testing.assert_allclose(gradient[:6, :6], a, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(gradient[:6, 10:], b, rtol=1e-9, atol=1e-9)
    for j in range(len(x)):
        step = np.zeros_like(x)
        step[j] = 1e-5
        columns = []
        for sign in (1.0, -1.0):
            context.SetContinuousState(x + sign * step)
            columns.append(plant.EvalTimeDerivatives(context).CopyToVector())
        np.testing.assert_allclose(gradient[:, j], (columns[0] - columns[1]) / 2e-5, rtol=1e-4, atol=1e-4)


def test_path_curvature_has_its_slope_in_drakes_gradients():
    plant = VehiclePlant(PARAMETERS, path=s_bend()).ToAutoDiffXd()
    context = plant.CreateDefaultContext()
    r, v, beta, omega_r, e, dphi = STATE
    x = InitializeAutoDiff([r, v, beta, omega_r, e, dphi, 30.0, 0.0, 0.0, 0.0]).ravel()
    context.SetContinuousState(x)
    plant.GetInputPort("actuation").FixValue(context, x[:2] * 0.0)
    s_dot = plant.EvalTimeDerivatives(context).CopyToVector()[6]
    curvature, slope = s_bend().curvature(30.0), 0.05 / 30.0
    expected = v * np.cos(dphi) * e * slope / (1.0 - curvature * e) ** 2
    assert s_dot.derivatives()[6] == pytest.approx(expected, rel=1e-9)


def test_parameters_of_the_context_can_be_changed_and_differentiated():
    plant = VehiclePlant(PARAMETERS)
    context = prepared(plant)
    before = plant.EvalTimeDerivatives(context).CopyToVector()
    constants = list(PARAMETERS.constants())
    friction = Constants._fields.index("friction")
    constants[friction] = 0.8
    context.get_mutable_numeric_parameter(0).SetFromVector(constants)
    slippery = plant.EvalTimeDerivatives(context).CopyToVector()
    other = VehiclePlant(PARAMETERS.replace(friction=0.8))
    np.testing.assert_array_equal(slippery, other.EvalTimeDerivatives(prepared(other)).CopyToVector())

    gradient_plant = plant.ToAutoDiffXd()
    gradient_context = gradient_plant.CreateDefaultContext()
    gradient_context.SetTimeStateAndParametersFrom(prepared(plant))
    parameters = InitializeAutoDiff(PARAMETERS.constants()).ravel()
    gradient_context.get_mutable_numeric_parameter(0).SetFromVector(parameters)
    gradient_plant.GetInputPort("actuation").FixValue(gradient_context, np.array([AutoDiffXd(u) for u in ACTUATION]))
    gradient = ExtractGradient(gradient_plant.EvalTimeDerivatives(gradient_context).CopyToVector()[:4])
    assert gradient.shape == (4, len(constants))
    assert np.all(np.isfinite(gradient))
    assert not np.allclose(gradient[:, friction], 0.0)
    assert not np.allclose(before, slippery)


@pytest.mark.parametrize("effects", [Effects(), MANY_EFFECTS])
def test_symbolic_plant_evaluates_to_the_same(effects):
    plant = VehiclePlant(PARAMETERS, effects, s_bend())
    context = prepared(plant)
    plant.GetInputPort("curvature").FixValue(context, np.array([0.02]))
    symbolic = plant.ToSymbolic()
    assert symbolic.path is plant.path
    assert symbolic.effects == effects
    count = len(plant.state_names)
    variables = MakeVectorVariable(count + 3, "z")
    symbols = np.array([Expression(variable) for variable in variables])
    symbolic_context = symbolic.CreateDefaultContext()
    symbolic_context.SetContinuousState(symbols[:count])
    symbolic.GetInputPort("actuation").FixValue(symbolic_context, symbols[count : count + 2])
    symbolic.GetInputPort("curvature").FixValue(symbolic_context, symbols[count + 2 :])
    x = context.get_continuous_state_vector().CopyToVector()
    environment = dict(zip(variables, (*x, *ACTUATION, 0.02), strict=True))
    rates = [f.Evaluate(environment) for f in symbolic.EvalTimeDerivatives(symbolic_context).CopyToVector()]
    np.testing.assert_allclose(rates, plant.EvalTimeDerivatives(context).CopyToVector(), rtol=1e-12, atol=1e-12)
    acceleration = [f.Evaluate(environment) for f in symbolic.GetOutputPort("acceleration").Eval(symbolic_context)]
    np.testing.assert_allclose(acceleration, plant.GetOutputPort("acceleration").Eval(context), rtol=1e-12)


def test_expression_cannot_pass_through_a_path():
    plant = VehiclePlant(PARAMETERS, path=s_bend()).ToSymbolic()
    context = plant.CreateDefaultContext()
    plant.GetInputPort("actuation").FixValue(context, np.array([Expression(0.0), Expression(0.0)]))
    with pytest.raises(ValueError, match="connect the port 'curvature'"):
        plant.EvalTimeDerivatives(context)
