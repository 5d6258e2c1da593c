"""Logs tell masses, inertias, stiffnesses and drive force by ratios: only priors tell their common scale."""

import numpy as np

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import sensitivity
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.problem import NUISANCES
from drift_drake.gap.identification.by_likelihood import STEP
from drift_drake.gap.identification.estimate import widened
from drift_drake.gap.identification.options import KNOWN

SCALED = ("mass", "yaw_inertia", "rear_axle_inertia", "torque", "front_stiffness", "rear_stiffness")


def test_derivatives_do_not_tell_the_common_scale(strange_car_runs):
    """A car with no drag of its own, all of it a thousandth heavier, stiffer and stronger, moves as before."""
    problem = make_problem(strange_car_runs, widened(VehicleParameters(), KNOWN)).replace(step=STEP)
    theta = np.zeros(problem.nuisances)
    jacobian = sensitivity(problem, filter_case(problem, theta, ()), theta, ()).dense()
    step = np.zeros(problem.nuisances)
    for name in SCALED:
        at = NUISANCES.index(name)
        step[at] = 1.0 / problem.tolerance[at]
    deviations = np.linalg.norm(jacobian @ step) * VehicleParameters().tolerance.mass
    assert deviations < 0.05  # by a tolerance of the mass: it is left as it was known
