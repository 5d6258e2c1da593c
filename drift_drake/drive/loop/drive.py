"""One drive of a simulated vehicle: any driver in closed loop with actuator, dither and car, logged at 100 Hz."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.path_plant import MotionError, PathPlant
from drift_drake.car.sensors import LOG_ROW, MEASURED_STATE, NoiseLevels
from drift_drake.car.single_track.motion import INPUTS
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output
from drift_drake.drive.loop.actuation import LinearInterpolationActuator
from drift_drake.drive.loop.car import Car
from drift_drake.drive.loop.runner import Logs, make_simulator
from drift_drake.drive.mpc.plan import interpolate_knots
from drift_drake.drive.reference.trajectory import Reference

LOG_PERIOD = 0.01  # [s]


class DriveLimits(NamedTuple):
    """When a drive is given up."""

    sideslip: float = 1.3  # [rad] of a spin
    min_speed: float = 4.0  # [m/s] of the car and of the rear rim; the models are not meant for standstill
    max_speed: float = 35.0  # [m/s]
    lane: float = 8.0  # [m] from the path, where there is one


class Dither(LeafSystem):
    """Adds a given small signal, linear between knots 0.1 s apart, to the command; keeps within the vehicle's limits.

    Input port: command [2]. Output port: command [2], which is what the car gets and the log holds.
    """

    def __init__(self, parameters: VehicleParameters, knots: Array) -> None:
        super().__init__()
        self._knots = knots
        self._low, self._high = parameters.command_limits()
        self._command = self.DeclareVectorInputPort("command", 2)
        declare_output(self, "dithered_command", 2, self._dithered, {self.time_ticket(), self._command.ticket()})

    def _dithered(self, context: Context) -> Array:
        command = self._command.Eval(context) + interpolate_knots(self._knots, context.get_time())
        return np.minimum(np.maximum(command, self._low), self._high)


class Drive:
    """The diagram of one driver and one vehicle.

    Systems: driver (a port measured_state in, where it has one, and a port plan out), actuator, dither, car, loggers.

    Raises:
        InvalidVehicleError: a parameter or an effect that no car has.

    Examples:
        >>> driver = ConstantVectorSource(Plan(0.0, np.zeros((2, 2))).vector())
        >>> table, ending = Drive(car, driver, 1, 0.1, None, (0.0, 0.0)).run(x[0], 0.0, duration=0.5, seed=0)
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        driver: LeafSystem,
        steps: int,
        plan_spacing: float,
        dither: Array | None,
        initial_command: tuple[float, float],
        effects: Effects = Effects(),
        reference: Reference | None = None,
        noise: NoiseLevels = NoiseLevels(),
        plant: PathPlant | None = None,
    ) -> None:
        """Args:
        parameters: the car without effects; driver: a system with a port plan out; steps, plan_spacing: of the driver's
            plans [s]; dither: [K, 2] that is added to its commands, if any.
        initial_command: (delta [rad], tau [N m]) before the first plan; effects: of the car; noise: of the sensors.
        reference: where the path comes from.
        plant: the true car, on that path, if it is not that of `parameters` and `effects`; see `Car`.
        """
        self._initial_command, self._reference = initial_command, reference
        builder = DiagramBuilder()
        self.driver = builder.AddNamedSystem("driver", driver)
        actuator = LinearInterpolationActuator(parameters, steps, plan_spacing, initial_command=initial_command)
        self.actuator = builder.AddNamedSystem("actuator", actuator)
        path = None if reference is None else reference.path
        self.car = builder.AddNamedSystem("car", Car(parameters, effects, path, noise, plant=plant))
        if driver.num_input_ports() > 0:
            builder.Connect(self.car.GetOutputPort("measured_state"), driver.GetInputPort("measured_state"))
        plan = driver.GetOutputPort("plan") if driver.HasOutputPort("plan") else driver.get_output_port(0)
        builder.Connect(plan, self.actuator.GetInputPort("plan"))
        command = self.actuator.GetOutputPort("command")
        if dither is not None:
            shaken = builder.AddNamedSystem("dither", Dither(parameters, dither))
            builder.Connect(command, shaken.GetInputPort("command"))
            command = shaken.GetOutputPort("dithered_command")
        builder.Connect(command, self.car.GetInputPort("command"))
        self._logs = Logs(builder, LOG_PERIOD)
        self._logs.add(self.car.GetOutputPort("log_row"), LOG_ROW, "log_row")
        self._logs.add(self.car.GetOutputPort("measured_state"), MEASURED_STATE, "measured_state")
        self._logs.add(command, [f"{name}_cmd" for name in INPUTS], "command")
        self.diagram = builder.Build()
        self.diagram.set_name("drive")

    def run(
        self,
        state: Array,
        s: float,
        duration: float,
        seed: int,
        limits: DriveLimits | None = None,
    ) -> tuple[pd.DataFrame, str]:
        """Drives from a state [6] (SI) at s [m] for `duration` [s] or until the limits.

        Args:
            seed: of the sensors' noise; limits: that end it early.

        Returns:
            (a row each 0.01 s: the log format's columns, and e, dphi, s; how it ended: "time", what limit, or
            "simulation failed" where the plant's state is no longer finite).
        """
        limits = limits or DriveLimits()
        context = self.diagram.CreateDefaultContext()
        plant = self.car.plant
        plant.set_initial(plant.GetMyMutableContextFromRoot(context), state, s, actuation=self._initial_command)
        self.car.sensors.set_seed(context, seed)

        def reason(root: Context) -> str | None:
            state = plant.GetOutputPort("full_state").Eval(plant.GetMyContextFromRoot(root))
            _, v, beta, omega_r, e = state[:5].tolist()  # plain numbers compare faster
            if abs(beta) > limits.sideslip:
                return "spin"
            if min(v, omega_r) < limits.min_speed or v > limits.max_speed:
                return "speed"
            return "left the road" if self._reference is not None and abs(e) > limits.lane else None

        simulator = make_simulator(self.diagram, context, (plant, reason))
        simulator.Initialize()
        try:
            ending = simulator.AdvanceTo(duration).message() or "time"
        except MotionError:  # of a car of another program, as a rule
            ending = "simulation failed"
        return self._logs.table(context), ending
