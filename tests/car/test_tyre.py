"""Tyres of another package, found by entry points: plant, Jacobian, controller, filter and vehicle files know them.

Most tests run in processes of their own, since tyres are found once; all but one without numba.
"""

from pathlib import Path

import pytest
from other_package import install_package, refusal, run

from drift_drake.car.tyre import installed_tyres

TYRES = """
from drift_drake.car.scalar import atan, select, tanh

def smooth(sigma, stiffness, peak):
    force = tanh(stiffness * sigma / peak)
    slope = stiffness * (1.0 - force * force)
    return peak * force / sigma, (slope - peak * force / sigma) / sigma

def stiff(sigma, stiffness, peak):
    return 2.0 * stiffness / (1.0 + stiffness * sigma / peak) ** 2, 0.0 * sigma

def no_slope(sigma, stiffness, peak):
    return peak * tanh(stiffness * sigma / peak) / sigma, 0.0 * sigma

def too_much(sigma, stiffness, peak):
    return stiffness, 0.0 * sigma
"""
PHYSICS = """
import math
import numpy as np
from pydrake.symbolic import Expression
from drift_drake import ClosedLoop, Mpc, NominalStepModel, VehicleParameters, VehiclePlant, figure_8, make_effects
from drift_drake.car.single_track.motion import motion, static_loads
from drift_drake.car.single_track.motion import linearize

car = VehicleParameters(tyre="smooth")
brush = car.replace(tyre="brush")

# The force is the tyre's: sliding sideways, against the formula.
slide = motion(0.0, 10.0, 0.3, 10.0, 0.3, 0.0, car.constants())
f_zr = static_loads(car.constants())[1]
sigma = math.hypot(1.0 - math.cos(0.3), math.sin(0.3))
lateral = math.tanh(car.rear_stiffness * sigma / f_zr) * f_zr * math.sin(0.3) / sigma
np.testing.assert_allclose(-slide.a_y * car.mass, lateral, rtol=1e-6)

# The hand-made Jacobian, with and without effects, against the plant's automatic one.
x, u = np.array([0.5, 12.0, -0.3, 14.0, 0.1, 0.2]), np.array([-0.1, 150.0])
x_dot, a, b = linearize(x, u, 0.0, car.constants())
plant = VehiclePlant(car).ToAutoDiffXd()
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
z = InitializeAutoDiff(np.append(x, u))[:, 0]
context = plant.CreateDefaultContext()
state = context.get_continuous_state_vector().CopyToVector()
state[:6] = z[:6]
context.SetContinuousState(state)
plant.GetInputPort("actuation").FixValue(context, z[6:])
rates = plant.EvalTimeDerivatives(context).CopyToVector()[:6]
np.testing.assert_allclose(ExtractValue(rates)[:, 0], x_dot, rtol=1e-9)
np.testing.assert_allclose(ExtractGradient(rates), np.hstack([a, b]), rtol=1e-6, atol=1e-6)
changed = VehiclePlant(car, make_effects({"aero_drag": 0.4}))
assert changed.has_internal_states
changed.ToSymbolic()

# The controller that believes in it plans otherwise than one that believes in the brush.
reference = figure_8(brush)
plans = [Mpc(NominalStepModel(c), c, reference, horizon=5).solve(reference.state(60.0), 60.0, 0.0).plan.u
         for c in (car, brush)]
assert np.isfinite(plans).all()
assert not np.allclose(*plans, atol=1e-4)
ClosedLoop(brush, reference, NominalStepModel(brush), plant=VehiclePlant(car, path=reference.path))
print("all hold")
"""


def install(folder: Path, name: str, attribute: str) -> None:
    install_package(folder, "rubber", TYRES, "tyres", {name: attribute})


@pytest.mark.parametrize("jit", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_plant_jacobian_and_controller_take_it(tmp_path: Path, jit: bool) -> None:
    install(tmp_path, "smooth", "smooth")
    done = run(tmp_path, "-c", PHYSICS, jit=jit)
    assert done.stdout == "all hold\n", done.stderr


def test_a_vehicle_file_names_it(tmp_path: Path) -> None:
    install(tmp_path, "smooth", "smooth")
    program = """
from drift_drake import Effects, VehicleParameters, read_vehicle, write_vehicle
from drift_drake.car.vehicle_file import vehicle_hash
car = VehicleParameters(tyre="smooth")
write_vehicle("car.yaml", car, Effects())
assert read_vehicle("car.yaml")[0] == car
assert vehicle_hash(car, Effects()) != vehicle_hash(VehicleParameters(), Effects())
"""
    assert run(tmp_path, "-c", program).stderr == ""
    assert "tyre: smooth" in (tmp_path / "car.yaml").read_text()


@pytest.mark.parametrize(
    ("name", "attribute", "says"),
    [
        ("brush", "smooth", "brush is there already"),
        ("odd", "nothing", "tyre odd (rubber:nothing): cannot be imported"),
        ("odd", "atan", "tyre odd (rubber:atan): fails at a slip of 1e-09"),
        ("odd", "too_much", "N at a slip of 0.15 and a peak of 8000 N"),
        ("odd", "no_slope", "its derivative at a slip of"),
        ("odd", "stiff", "tyre odd (rubber:stiff): its derivative at a slip of"),
    ],
)
def test_one_that_cannot_be_used_is_named(tmp_path: Path, name: str, attribute: str, says: str) -> None:
    install(tmp_path, name, attribute)
    said = refusal("rubber", tmp_path, installed_tyres.__wrapped__)
    assert says in said
    assert "\n" not in said


def test_the_command_line_says_so_in_one_sentence(tmp_path: Path) -> None:
    install(tmp_path, "brush", "smooth")
    done = run(tmp_path, "-m", "drift_drake", "effects")
    assert (done.returncode, done.stdout) == (2, "")
    assert "brush is there already" in done.stderr
    assert done.stderr.count("\n") == 1
