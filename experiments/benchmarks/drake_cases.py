"""Blind cases from Drake plants: the car with withheld effects, a driver, strange forces and sensors as one diagram.

Another integrator than the diagnosis's: Runge-Kutta of third order with error control.
"""

from typing import Any, Protocol

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, DiscreteValues, LeafSystem

from drift_drake.car.effects.delays import on_time, stamped
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.sensors import LOG_ROW
from drift_drake.common.updates import declare_update
from drift_drake.drive.loop.car import Car
from drift_drake.drive.loop.runner import add_logger, make_simulator
from experiments.benchmarks.drivers import MANOEUVRES, PERIOD, SLOWEST, SPIN, Driver, driven
from experiments.benchmarks.strange_effects import Strange, make_strange, ring_rates, rung_torque, strange_wrench
from experiments.benchmarks.truths import Truth, true_car

ACCURACY = 1e-6


class RowDriver(Protocol):
    """A driver that gives a command for each row of the log."""

    def start(self) -> np.ndarray:
        """First state (r, v, beta, omega_r)."""

    def resting_command(self) -> tuple[float, float]:
        """Command before the first row."""

    def command(self, t: float, state: np.ndarray, last: tuple[float, float]) -> tuple[float, float]:
        """Command a row after t, from the state (r, v, beta, omega_r, e, dphi) at t and the command then."""


class DriverSystem(LeafSystem):
    """A driver as a system: a new command each row, reached linearly by the next one.

    Input ports: state (6). Output ports: command (delta [rad], tau [N m]).
    """

    def __init__(self, driver: RowDriver, first: tuple[float, float]) -> None:
        LeafSystem.__init__(self)
        self._driver = driver
        self._state = self.DeclareVectorInputPort("state", 6)
        self.DeclareDiscreteState([0.0, *first, *first])  # time of the update, command then, command a row later
        declare_update(self, PERIOD, self._update)
        self.DeclareVectorOutputPort(
            "command", 2, self._calc_command, prerequisites_of_calc={self.time_ticket(), self.xd_ticket()}
        )

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        _, _, _, delta, tau = context.get_discrete_state_vector().value()
        t = context.get_time()
        wanted = self._driver.command(t, self._state.Eval(context), (delta, tau))
        discrete.get_mutable_vector().SetFromVector([t, delta, tau, *wanted])

    def _calc_command(self, context: Context, output: Any) -> None:
        t, delta, tau, next_delta, next_tau = context.get_discrete_state_vector().value()
        share = min(max((context.get_time() - t) / PERIOD, 0.0), 1.0)
        output.SetFromVector([delta + share * (next_delta - delta), tau + share * (next_tau - tau)])


class StrangeForces(LeafSystem):
    """Forces of the families that the catalogue lacks.

    Input ports: state (6), pose (3), command (2). Output ports: wrench (3) for the plant's disturbance.
    """

    def __init__(self, constants: Constants, strange: Strange) -> None:
        LeafSystem.__init__(self)
        self._constants, self._strange = constants, strange
        self._state = self.DeclareVectorInputPort("state", 6)
        self._pose = self.DeclareVectorInputPort("pose", 3)
        self._command = self.DeclareVectorInputPort("command", 2)
        self.DeclareVectorOutputPort("wrench", 3, self._calc_wrench)

    def _calc_wrench(self, context: Context, output: Any) -> None:
        r, v, beta, omega_r = (float(c) for c in self._state.Eval(context)[:4])
        x, y, psi = (float(c) for c in self._pose.Eval(context))
        delta, tau = (float(c) for c in self._command.Eval(context))
        output.SetFromVector(
            strange_wrench(
                context.get_time(), r, v, beta, omega_r, x, y, psi, delta, tau, self._constants, self._strange
            )
        )


class Driveline(LeafSystem):
    """A driveline that rings: part of the torque passes an oscillator.

    Input ports: command (2). Output ports: command (2), its torque rung.
    """

    def __init__(self, strange: Strange, torque: float) -> None:
        LeafSystem.__init__(self)
        self._strange = strange
        self._command = self.DeclareVectorInputPort("command", 2)
        self.DeclareContinuousState(BasicVector([torque, 0.0]))
        self.DeclareVectorOutputPort("command", 2, self._calc_command)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: Any) -> None:  # noqa: N802
        ring, rate = context.get_continuous_state_vector().CopyToVector()
        derivatives.get_mutable_vector().SetFromVector(ring_rates(ring, rate, self._command.Eval(context)[1]))

    def _calc_command(self, context: Context, output: Any) -> None:
        delta, tau = self._command.Eval(context)
        output.SetFromVector([delta, rung_torque(tau, context.get_continuous_state_vector()[0], self._strange)])


def drive(
    driver: RowDriver, truth: Truth, vehicle: VehicleParameters, seed: int, name: str, duration: float = 12.0,
    heading: float = 0.0,
) -> Run:  # fmt: skip
    """One run in Drake, ended early by a spin: driver, strange forces and the car that `truth` describes."""
    constants, effects = true_car(truth, vehicle)
    strange = make_strange(truth.strange)
    first = driver.command(0.0, np.append(driver.start(), [0.0, 0.0]), driver.resting_command())
    builder = DiagramBuilder()
    parameters = vehicle.with_constants(constants)
    car = builder.AddNamedSystem("car", Car(parameters, on_time(effects)))
    driving = builder.AddNamedSystem("driver", DriverSystem(driver, first))
    builder.Connect(car.GetOutputPort("state"), driving.GetInputPort("state"))
    command = driving.GetOutputPort("command")
    if truth.strange:
        forces = builder.AddNamedSystem("strange_forces", StrangeForces(constants, strange))
        driveline = builder.AddNamedSystem("driveline", Driveline(strange, first[1]))
        builder.Connect(car.GetOutputPort("state"), forces.GetInputPort("state"))
        builder.Connect(car.GetOutputPort("pose"), forces.GetInputPort("pose"))
        builder.Connect(command, forces.GetInputPort("command"))
        builder.Connect(forces.GetOutputPort("wrench"), car.GetInputPort("disturbance"))
        builder.Connect(command, driveline.GetInputPort("command"))
        builder.Connect(driveline.GetOutputPort("command"), car.GetInputPort("command"))
    else:
        builder.Connect(command, car.GetInputPort("command"))
    command_log = add_logger(builder, command, "command", PERIOD)
    row_log = add_logger(builder, car.GetOutputPort("log_row"), "log_row", PERIOD)
    diagram = builder.Build()
    diagram.set_name("drake_case")
    context = diagram.CreateDefaultContext()
    car_context = car.GetMyMutableContextFromRoot(context)
    plant_context = car.plant.GetMyMutableContextFromRoot(context)
    car.plant.set_initial(plant_context, [*driver.start(), 0.0, 0.0], pose=(0.0, 0.0, heading), actuation=first)
    car.sensors.set_seed(context, seed)
    state = car.GetOutputPort("state")

    def spun(_root: Context) -> str | None:
        r, v, beta, omega_r = state.Eval(car_context)[:4]
        return "spin" if abs(beta) > SPIN or v < SLOWEST or omega_r < SLOWEST or abs(r) > 6.0 else None

    make_simulator(diagram, context, (car, spun), ACCURACY).AdvanceTo(duration)
    rows, commands = row_log.FindLog(context).data(), command_log.FindLog(context).data()
    given, kept = stamped({"delta_cmd": commands[0].copy(), "tau_cmd": commands[1].copy()}, effects, PERIOD)
    columns = dict(zip(LOG_ROW, rows[:, :kept], strict=True))
    columns["t"] = np.round(columns["t"], 9)
    return Run(name=name, delta_cmd=given["delta_cmd"], tau_cmd=given["tau_cmd"], **columns)


def drake_case(truth: Truth, vehicle: VehicleParameters, rng: np.random.Generator, duration: float = 12.0) -> list[Run]:
    """Four runs of one car (`drivers.driven`)."""
    return driven(
        MANOEUVRES,
        lambda kind, name: drive(Driver(kind, rng, vehicle), truth, vehicle, int(rng.integers(2**31)), name, duration),
    )
