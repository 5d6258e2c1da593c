"""The closed loop: reference, car (plant and sensors), actuator, MPC controller and loggers."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort, System

from drift_drake.car.effects.delays import sensor_delay
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.given_vehicle import GivenEffects, effects_given
from drift_drake.car.latency import at_present
from drift_drake.car.log.driving import slowest
from drift_drake.car.on_path import POSE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.path_plant import MotionError, PathPlant
from drift_drake.car.sensor_errors import without_errors
from drift_drake.car.sensors import LOG_ROW, MEASURED_STATE, NoiseLevels
from drift_drake.car.single_track.motion import INPUTS, STATES
from drift_drake.car.single_track.plant import acts_on_motion
from drift_drake.car.step_model import StepModel
from drift_drake.common.arrays import Array
from drift_drake.common.errors import one_line
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.loop.actuation import LinearInterpolationActuator
from drift_drake.drive.loop.car import Car
from drift_drake.drive.loop.endings import Ending, Outcome, RunLimits
from drift_drake.drive.loop.fault_systems import FaultPoints
from drift_drake.drive.loop.faults import Change, Fault, check_change, make_change, patches, with_patches
from drift_drake.drive.loop.learners import Learners, check_planner, lane_tightening
from drift_drake.drive.loop.metrics import RunMetrics, run_metrics
from drift_drake.drive.loop.runner import LogFile, Logs, make_simulator, read_log
from drift_drake.drive.loop.watch import LoopPorts, LoopWatch, Watched
from drift_drake.drive.mpc.controller import Controller, MpcController
from drift_drake.drive.mpc.mpc import Mpc, SolveStatistics
from drift_drake.drive.mpc.ocp import OcpWeights
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.mpc.sqp import SqpOptions
from drift_drake.drive.mpc.stopping import SafeStop
from drift_drake.drive.mpc.system_controller import OwnController, controller_system
from drift_drake.drive.qp.qp import QpMethod
from drift_drake.drive.reference.similarity import similarity
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.drive.screening.screen import Innovation, Screen

NEGLIGIBLE = 1e-9  # [N s^2/m^2] of drag, with which a car has the states of effects and nothing else


@dataclasses.dataclass(frozen=True)
class ControlConfig:
    """How the controller is set up; the same for every model that it is given.

    Raises:
        ValueError: a delay, tolerance or patience out of its range.

    Examples:
        >>> loop = ClosedLoop(car, reference, NominalStepModel(car), control=ControlConfig(horizon=20))
    """

    horizon: int = 25  # N, steps of the model: 0.1 s for a car of the default one's size
    period: float = 0.01  # [s] between plans
    delay: float = 0.01  # [s] from a measurement until its plan is in force
    qp: QpMethod = "stagewise"  # what solves the plans' quadratic programs; osqp alone leaves some of them unsolved
    osqp_iterations: int = 30  # at most, of one QP; with 200 few are left unsolved, and a third of the plans are late
    iterations: int = 2  # SQP steps a plan at most; one where the dynamics' defect after it is within its tolerance
    tolerance: float | None = None  # [-] of a plan's residuals, in place of `iterations`
    tightening: float = 0.0  # [-] deviations of the predicted e by which the lane is narrowed; learnt models only
    screening: bool = True  # of readings, by what a car can do and by what the model predicts
    fresh_guesses: bool = True  # plans from the reference, worked out in parallel, against other local optima
    patience: float = 0.5  # [s] of age of the plan in force, after which the car is stopped on its lane; 0 for never
    weights: OcpWeights = dataclasses.field(default_factory=OcpWeights)  # of the cost, of a car of the default size

    def __post_init__(self) -> None:
        # The actuator keeps one plan that waits for its time; a newer one each period would replace it for ever.
        if not 0.0 <= self.delay < 2.5 * self.period:
            raise ValueError(
                f"control.delay is {self.delay:g} s: no plan would ever come into force; give at most two periods "
                f"({2.0 * self.period:g} s)"
            )
        if self.tolerance is not None and not 0.0 < self.tolerance < math.inf:
            raise ValueError(f"control.tolerance is {self.tolerance:g}: give a number above 0, or leave it out")
        if not 0.0 <= self.patience < math.inf:
            raise ValueError(f"control.patience is {self.patience:g} s; give a time above 0 s, or 0 for never")


class ClosedLoop:
    """The diagram with its parts at hand. Built once; each run takes a fresh Context.

    Systems: car (plant, sensors), screen, controller, safe_stop, actuator, and loggers of measured_state, log_row,
    state, path_position, pose, command, statistics and what the others tell.

    Args:
        parameters: what the controller and the reference's limits take the car for.
        model: what the predictive controller believes.
        effects: of the true car, in addition to `parameters`: Effects, or magnitudes by name.
        reference: what to drive; noise: of the sensors; control: how the controller is set up.
        initial_command: (delta [rad], tau [N m]) in force before the first plan; the reference's without.
        adapter: if given, `model` (a `BayesianStepModel`) follows it.
        plant: the true car, on the reference's path, if it is not that of `parameters` and `effects`; see `Car`.
        faults: what goes wrong in the loop.
        watch: if given, it watches the car, and acts by its policy (`gap.monitoring.in_loop.GapWatch`).
        sensor_errors: what is known of the sensors' errors, taken off the readings (`SensorCorrection`), and of their
            latency, over which a model of a known car runs them on (`LatencyCompensation`).
        controller: one of your own in place of the predictive one and its model: an object with `evaluate`, or a Drake
            system from a reading [7], or its first six, to a command [2].

    Raises:
        InvalidVehicleError: an effect that no car has; InvalidControllerError: a controller that is none.
        ValueError: both a model and a controller, or neither; a tightened lane without an adapter; a watch whose
            policy the model does not serve.

    Examples:
        >>> loop = ClosedLoop(car, reference, NominalStepModel(car))
        >>> loop.run(loop.initial_context(seed=1), RunLimits(time_factor=0.01)).outcome
        'time is up'
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        reference: Reference,
        model: StepModel | None = None,
        effects: GivenEffects = Effects(),
        noise: NoiseLevels = NoiseLevels(),
        control: ControlConfig = ControlConfig(),
        initial_command: tuple[float, float] | None = None,
        adapter: BayesianAdapter | None = None,
        plant: PathPlant | None = None,
        faults: Sequence[Fault] = (),
        watch: LoopWatch | None = None,
        controller: Controller | System | None = None,
        sensor_errors: Effects = Effects(),
    ) -> None:
        effects = effects_given(effects)
        learners = Learners(model, adapter, lane_tightening(control.tightening, adapter))
        check_planner(learners, controller)
        if plant is None and patches(faults) and not acts_on_motion(effects):
            effects = effects._replace(aero_drag=NEGLIGIBLE)
        self.parameters, self.reference, self.adapter, self.effects = parameters, reference, adapter, effects
        self._faults = tuple(faults)
        at_start = tuple(reference.input(0.0)) if initial_command is None else initial_command
        self.initial_command = (float(at_start[0]), float(at_start[1]))
        builder = DiagramBuilder()
        points = FaultPoints(builder, faults, control.period)
        self.car = builder.AddNamedSystem("car", Car(parameters, effects, reference.path, noise, plant=plant))
        self.controller = builder.AddNamedSystem(
            "controller", self._planner(learners, controller, control, 0 if watch is None else watch.effects_size)
        )
        self.actuator = builder.AddNamedSystem("actuator", LinearInterpolationActuator(
            parameters, control.horizon, DT if model is None else model.dt, control.period,
            initial_command=self.initial_command,
        ))  # fmt: skip
        command = self.actuator.GetOutputPort("command")
        received = points.sensors(self.car.GetOutputPort("measured_state"))
        corrected = without_errors(builder, received, sensor_errors)
        known = at_present(builder, corrected, command, sensor_delay(sensor_errors), learners.car, reference.path,
                           control.period)  # fmt: skip
        self.screen, measured_state, state = self._screened(builder, control, noise, known)
        plan = points.plans(self.controller.GetOutputPort("plan"))
        reading = None if self.screen is None else self.screen.GetOutputPort("reading")
        ports = LoopPorts(measured_state, command, self.car.GetOutputPort("log_row"), plan, reading)
        watched = Watched(measured_state, plan, {})
        if watch is not None:
            watched = watch.watching(builder, ports, model, parameters, reference, control.horizon, control.period)
        self.watch, self.pace = watch, watched.pace
        self.safe_stop, plan = self._supervised(builder, control, watched.plan, state)
        builder.Connect(plan, self.actuator.GetInputPort("plan"))
        measured_state = watched.measured_state
        builder.Connect(points.solver(measured_state), self.controller.GetInputPort("measured_state"))
        if isinstance(self.controller, MpcController):
            learners.connect(builder, self.controller, measured_state, command, watched.effects, watched.trusted)
        builder.Connect(points.actuators(command, parameters), self.car.GetInputPort("command"))
        self.logs = Logs(builder, control.period)
        for name, (port, columns) in (self._logged(received) | watched.logged).items():
            self.logs.add(port, columns, name)
        self.diagram: Diagram = builder.Build()
        self.diagram.set_name("closed_loop")

    def _planner(
        self, learners: Learners, controller: Controller | System | None, control: ControlConfig, effects_size: int
    ) -> MpcController | OwnController:
        """The system that plans; `effects_size`: of the effects that a correction gives the model."""
        if controller is not None:
            return controller_system(controller, control.horizon, control.period, control.delay)
        assert learners.model is not None
        options = SqpOptions.real_time(control.iterations, control.qp, control.osqp_iterations)
        if control.tolerance is not None:
            options = SqpOptions.converging(control.tolerance, control.qp)
        mpc = Mpc(
            learners.model, self.parameters, self.reference, control.horizon,
            control.weights.of_size(similarity(self.parameters)), options, control.delay, self.initial_command,
            learners.tightening, control.fresh_guesses,
        )  # fmt: skip
        return MpcController(mpc, control.period, learners.theta_size or effects_size)

    def _screened(
        self, builder: DiagramBuilder, control: ControlConfig, noise: NoiseLevels, received: OutputPort
    ) -> tuple[Screen | None, OutputPort, OutputPort]:
        """(the screen, the measured state that it lets through, the state that it makes of it)."""
        if not control.screening:
            return None, received, received
        innovation = Innovation(self.parameters, self.reference.path, noise, control.period)
        screen = builder.AddNamedSystem("screen", Screen(control.period, innovation))
        builder.Connect(received, screen.GetInputPort("measured_state"))
        builder.Connect(self.actuator.GetOutputPort("command"), screen.GetInputPort("command"))
        return screen, screen.GetOutputPort("screened_state"), screen.GetOutputPort("estimate")

    def _supervised(
        self, builder: DiagramBuilder, control: ControlConfig, plan: OutputPort, state: OutputPort
    ) -> tuple[SafeStop | None, OutputPort]:
        """(the supervisor, the plan that it hands on)."""
        if control.patience == 0.0:
            return None, plan
        stop = SafeStop(self.parameters, self.reference, control.horizon, control.patience, control.period)
        builder.AddNamedSystem("safe_stop", stop)
        builder.Connect(plan, stop.GetInputPort("plan"))
        builder.Connect(state, stop.GetInputPort("state"))
        for name in ("plan_age", "command"):
            builder.Connect(self.actuator.GetOutputPort(name), stop.GetInputPort(name))
        return stop, stop.GetOutputPort("supervised_plan")

    def initial_context(self, seed: int, error: Array | None = None) -> Context:
        """A Context with the car at the reference's start, off by `error` [6] (SI), and its noise seeded by `seed`."""
        context = self.diagram.CreateDefaultContext()
        state = self.reference.state(0.0) + (np.zeros(6) if error is None else error)
        plant = self.car.plant
        plant.set_initial(plant.GetMyMutableContextFromRoot(context), state, 0.0, actuation=self.initial_command)
        self.car.sensors.set_seed(context, seed)
        return context

    def _stopping(self, root: Context) -> bool:
        return self.safe_stop is not None and self.safe_stop.stopping(self.safe_stop.GetMyContextFromRoot(root))

    @one_blas_thread()
    def run(
        self, context: Context, limits: RunLimits = RunLimits(), accuracy: float = 1e-4, change: Change | None = None,
        log_to: Path | None = None,
    ) -> "ClosedLoopRun":  # fmt: skip
        """Simulates until the reference's end, a safe stop, a spin, the lane's edge or the time limit.

        An error of the integrator or of a system ends the run as "simulation failed", with what it left.

        Args:
            context: see `initial_context`; limits: that end it early; accuracy: of the integrator [-]; change: of the
                car on the way.
            log_to: a CSV to write the log to on the way, for drives of many minutes, whose log fills the memory.

        Raises:
            ValueError: a change of a car that was built without effects, whose plant has no states for any, or one
                that the plant cannot make; OutputError: the log cannot be written.
        """
        if change is not None:
            check_change(change, self.parameters, self.effects, self.car.plant.has_internal_states)
        if isinstance(self.controller, MpcController):
            self.controller.warm_up()
        plant, reference = self.car.plant, self.reference
        file = None if log_to is None else LogFile(self.logs, log_to)
        ending = Ending(reference, limits, slowest(self.parameters))

        def reason(root: Context) -> Outcome | None:
            if file is not None:
                file.take(root)
            state = plant.GetOutputPort("full_state").Eval(plant.GetMyContextFromRoot(root))
            return ending(root.get_time(), state, self._stopping(root))

        simulator = make_simulator(self.diagram, context, (plant, reason), accuracy)
        duration = reference.duration if self.pace is None else reference.distance / self.pace
        end = context.get_time() + limits.time_factor * duration
        error = ""
        try:
            status = simulator.Initialize()
            for event in with_patches(change, self.effects, self._faults):
                if status.message() or event.time >= end:
                    break
                status = simulator.AdvanceTo(event.time)
                if not status.message():
                    command = self.actuator.GetOutputPort("command").Eval(self.actuator.GetMyContextFromRoot(context))
                    make_change(event, plant, plant.GetMyMutableContextFromRoot(context), command)
            if not status.message():
                status = simulator.AdvanceTo(end)
            if not status.message() and self._stopping(context):
                status = simulator.AdvanceTo(end + limits.stopping_time)
            outcome: Outcome = status.message() or "time is up"
        except (MotionError, RuntimeError, SystemExit) as failure:  # SystemExit is how Drake's assertions fail
            outcome, error = "simulation failed", one_line(failure)
        log = self.logs.table(context) if file is None else file.finish(context)
        return ClosedLoopRun(log, outcome, reference, self.parameters, error, self.watch)

    def _logged(self, received: OutputPort) -> dict[str, tuple[OutputPort, Sequence[str]]]:
        """What is logged: a port and its columns in the table, by name."""
        car, actuator = self.car, self.actuator
        further = [f"measured_{name}" if name in ("psi", "ax", "ay") else "" for name in LOG_ROW]  # of a log's row
        logged = {
            "state": (car.GetOutputPort("state"), STATES),
            "path_position": (car.GetOutputPort("path_position"), ("s",)),
            "pose": (car.GetOutputPort("pose"), POSE),
            "command": (actuator.GetOutputPort("command"), INPUTS),
            "plan_status": (actuator.GetOutputPort("status"), ("plan_status",)),
            "plan_age": (actuator.GetOutputPort("plan_age"), ("plan_age",)),
            "refused": (actuator.GetOutputPort("refused"), ("refused_plans",)),
            "measured_state": (received, [f"measured_{name}" for name in MEASURED_STATE]),
            "statistics": (
                self.controller.GetOutputPort("statistics"), [f"solve_{name}" for name in SolveStatistics._fields]
            ),
            "log_row": (car.GetOutputPort("log_row"), further),
        }  # fmt: skip
        if self.screen is not None:
            logged["reading"] = (self.screen.GetOutputPort("reading"), ("reading",))
        if self.safe_stop is not None:
            logged["stopping"] = (self.safe_stop.GetOutputPort("stopping"), ("stopping",))
        return logged


@dataclasses.dataclass(frozen=True)
class ClosedLoopRun:
    """One run: a row each control period (true states, commands, `measured_...`, `solve_...`), and how it ended."""

    log: pd.DataFrame | Path  # the rows, or the file that they are in
    outcome: Outcome
    reference: Reference
    parameters: VehicleParameters
    error: str = ""  # why the simulation failed
    watch: LoopWatch | None = None  # that watched, if one did

    @property
    def table(self) -> pd.DataFrame:
        """The rows; those of a file are read anew each time."""
        return self.log if isinstance(self.log, pd.DataFrame) else read_log(self.log)

    def metrics(self) -> RunMetrics:
        return run_metrics(self.table, self.outcome, self.reference, self.parameters.steering_limit)
