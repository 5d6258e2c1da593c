"""Delays of another package: to the bit the catalogue's own, of either command, and fitted from logs.

As in `test_installed_effects`: in a process of its own, without numba.
"""

from pathlib import Path

import pytest
from other_package import DELAYS, install, run

PREAMBLE = """
import dataclasses
import numpy as np
from drift_drake import Effects, VehicleParameters, make_effects
from experiments.benchmarks import compiled_cases
from experiments.benchmarks.compiled_cases import simulate_run
from experiments.benchmarks.drivers import Driver
from experiments.benchmarks.truths import Truth
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.windows import run_errors, windowed

car, late = VehicleParameters(), 0.043
compiled_cases.FINE = 4  # steps a row: nothing is compiled here, and all that is compared takes the same

class Silent:
    def standard_normal(self, count):
        return np.zeros(count)

def drive(effects, kind="slalom", seconds=0.8, noise=Silent()):
    return simulate_run(Driver(kind, np.random.default_rng(2), car), Truth(effects), car, noise, "run_0", seconds)
"""
ALIKE = """
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial
from drift_drake.gap.next_drive.plan import stand_ins
from drift_drake.car.actuated import actuated, without_actuators
from drift_drake.gap.estimation.problem import START_MATTERS
from drift_drake.gap.monitoring.bank import make_bank
from drift_drake.drive.loop.car import Car

def moved(name):
    builder = DiagramBuilder()
    body = builder.AddNamedSystem("car", Car(car, make_effects({name: late})))
    steps = PiecewisePolynomial.FirstOrderHold([0.0, 0.1, 0.2, 1.0], np.array([[0, 0, 0.1, 0], [50, 50, 150, 90.0]]))
    builder.Connect(builder.AddSystem(TrajectorySource(steps)).get_output_port(), body.GetInputPort("command"))
    simulator = Simulator(builder.Build())
    own = body.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    body.plant.set_initial(own, [0.0, 12.0, 0.0, 12.1, 0.0, 0.0], actuation=(0.0, 50.0))
    simulator.AdvanceTo(0.5)
    return body.plant.GetOutputPort("state").Eval(own)

# Plants and predictions, to the bit.
own, theirs = make_effects({"steering_delay": late}), make_effects({"bus_delay": late})
np.testing.assert_array_equal(moved("bus_delay"), moved("steering_delay"))
assert np.any(moved("engine_delay") != moved("steering_delay"))
logs = drive({"steering_delay": late}), drive({"bus_delay": late})
for column in ("r", "v", "beta", "omega_r", "delta_cmd", "tau_cmd"):
    np.testing.assert_array_equal(getattr(logs[0], column), getattr(logs[1], column))
log = windowed(logs[0])
log = dataclasses.replace(log, starts=log.starts[:1])
np.testing.assert_array_equal(run_errors(log, car.constants(), own), run_errors(log, car.constants(), theirs))
problem = make_problem([logs[0]], car)
theta = np.append(np.zeros(problem.nuisances), late)
filtered = [filter_case(problem, theta, (name,)).innovations[0] for name in ("steering_delay", "bus_delay")]
np.testing.assert_array_equal(*filtered)

# Two delays of one command add up, each command has its own, and what acts of them on commands is taken once.
row = np.cumsum(np.random.default_rng(0).standard_normal(60))
mixed = make_effects({"steering_delay": 0.02, "bus_delay": 0.03, "engine_delay": 0.02})
delta, torque = actuated(row, row, (1.0, 1.0), 0.01, mixed)
np.testing.assert_array_equal(delta, actuated(row, row, (1.0, 1.0), 0.01, make_effects({"steering_delay": 0.05}))[0])
np.testing.assert_array_equal(torque, actuated(row, row, (1.0, 1.0), 0.01, make_effects({"steering_delay": 0.02}))[0])
assert without_actuators(mixed) == Effects()
bank = make_bank([], car, mixed, 0.01, np.ones(9), np.ones(9))
np.testing.assert_allclose(bank.delays, [[5.0, 2.0]])
assert stand_ins(mixed) == make_effects({"steering_lag": 0.05, "torque_lag": 0.02})
assert "bus_delay" in START_MATTERS[0] and "engine_delay" in START_MATTERS[1]
print("all hold")
"""
FITTED = """
from drift_drake.gap.estimation.robust_fit import robust_fit
from drift_drake.gap.estimation.unknowns import unknown

log = windowed(drive({"engine_delay": 0.09}, "power", 1.6))
log = dataclasses.replace(log, starts=log.starts[::3])
predicted = lambda cars: [run_errors(log, car.constants(), make_effects(found)) for found in cars]
fit = robust_fit(predicted, [unknown("engine_delay", car, frozenset())], evidence=1.0)
print(fit.names[0], fit.theta[0])
"""


def test_one_is_the_catalogues_own_to_the_bit(tmp_path: Path) -> None:
    install(tmp_path, DELAYS)
    done = run(tmp_path, "-c", PREAMBLE + ALIKE)
    assert done.stdout == "all hold\n", done.stderr


@pytest.mark.slow
def test_one_is_fitted_from_windows(tmp_path: Path) -> None:
    install(tmp_path, DELAYS)
    done = run(tmp_path, "-c", PREAMBLE + FITTED)
    name, magnitude = (done.stdout or done.stderr).split()
    assert name == "engine_delay"
    assert abs(float(magnitude) - 0.09) < 0.002
