"""Windows and the filter on a car that reverses: under the car's own equations nothing is left of their errors."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.plant import VehiclePlant
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.usable import admit
from drift_drake.gap.estimation.windows import errors, windowed

ONE, TWO, BRUSH = VehicleParameters(), DoubleTrackParameters(), BrushParameters()


def reversing_run(plant):
    """A log as the log format has it, speed and course: to and fro with a steering that swings."""
    t = np.arange(0.0, 16.0, 0.01)
    u = np.stack([0.15 * np.sin(1.7 * t), 120.0 * np.cos(0.8 * t)])
    builder = DiagramBuilder()
    builder.AddNamedSystem("plant", plant)
    source = builder.AddNamedSystem("command", TrajectorySource(PiecewisePolynomial.FirstOrderHold(t, u)))
    builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
    log = LogVectorOutput(plant.GetOutputPort("full_state"), builder, 0.01)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant.set_initial(plant.GetMyMutableContextFromRoot(context), np.zeros(6), actuation=tuple(u[:, 0]))
    simulator = Simulator(diagram, context)
    simulator.get_mutable_integrator().set_target_accuracy(1e-7)
    simulator.AdvanceTo(t[-1])
    x = log.FindLog(context).data()
    r, v, beta, omega_r = x[:4]
    course = np.angle(np.sign(v + 1e-12) * np.exp(1j * beta))
    return Run("to_and_fro", t, r, np.abs(v), u[0], u[1], course, omega_r, psi=x[9], x=x[7], y=x[8])


@pytest.mark.parametrize(("plant", "car"), [(VehiclePlant, ONE), (EquationsPlant, TWO), (EquationsPlant, BRUSH)])
def test_windows_of_a_car_that_reverses_are_predicted_to_nothing(plant, car):
    runs, _, _ = admit([reversing_run(plant(car))], car)
    assert sum(part.v.max() < 0.0 for part in runs) >= 2
    for part in runs:
        found = errors([windowed(part)], car.constants(), Effects())
        assert np.quantile(np.abs(found[..., :4]), 0.95) < 5e-3, part.name


def test_the_filter_follows_a_car_that_reverses():
    runs, _, _ = admit([reversing_run(VehiclePlant(ONE))], ONE)
    problem = make_problem(runs, ONE)
    e = filter_case(problem, np.zeros(problem.nuisances), ()).innovations
    ways = {way: np.concatenate([x[run.counted] for x, run, part in zip(e, problem.runs, runs, strict=True)
                                 if (part.v.max() < 0.0) == way]) for way in (False, True)}  # fmt: skip
    assert np.mean(ways[True] ** 2) < 2.0 * np.mean(ways[False] ** 2)
