"""A log's commands to several cars at once, in one Drake diagram, put back onto the real car every few seconds."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator, SimulatorStatus
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus, LeafSystem
from pydrake.systems.primitives import Adder, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.effects.delays import as_commanded, on_time, sensor_delay
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.log.driving import SPUN, driven, slowest, spans
from drift_drake.car.log.measured_motion import MeasuredMotion, measured_motion
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.car.path_plant import POSE_AT
from drift_drake.car.road import bank_force
from drift_drake.car.sensors import LOG_ROW, NoiseLevels
from drift_drake.car.single_track.motion import INPUTS
from drift_drake.common.arrays import Array
from drift_drake.common.selector import select_signals
from drift_drake.common.updates import declare_output
from drift_drake.drive.loop.car import Car
from drift_drake.drive.loop.runner import add_logger, make_simulator
from drift_drake.view.playback.rolled_out import rolled_out

ACCURACY = 1e-5
LOST_SIDESLIP, LOST_SPEED = 1.4, 0.3  # [rad] beyond, in slowest speeds below which a simulated car is lost
FOLLOWING_TIME = 0.02  # [s] in which a car without a logged torque takes on the logged rim speed
KEEPING_TIME = 0.1  # [s] in which one without a rim speed either takes on the logged speed


class CarModel(NamedTuple):
    """What a vehicle file holds."""

    parameters: CarParameters
    effects: Effects = Effects()


class Keeper(LeafSystem):
    """What keeps a car at a measured speed, for logs that do not say what drove it.

    Input ports: state (6); wanted (1) [m/s]. Output port: by the law, from the state and the speed wanted.
    """

    def __init__(self, size: int, law: Callable[[Array, float], Sequence[float]]) -> None:
        LeafSystem.__init__(self)
        state, wanted = self.DeclareVectorInputPort("state", 6), self.DeclareVectorInputPort("wanted", 1)
        declare_output(self, "kept", size, lambda context: law(state.Eval(context), wanted.Eval(context)[0]))


def rim_speed_follower(p: VehicleParameters) -> Keeper:
    """The engine torque [N m], unlimited, that makes a car's rear wheels take on a given rim speed."""
    gain = p.rear_axle_inertia / (p.wheel_radius * p.gear_ratio * FOLLOWING_TIME)
    return Keeper(1, lambda state, rim_speed: [gain * (rim_speed - state[3])])


def speed_keeper(p: VehicleParameters) -> Keeper:
    """The force along the course that keeps a car at a given speed, as a wrench (3) for a plant's disturbance."""

    def wrench(state: Array, speed: float) -> Sequence[float]:
        force = p.mass / KEEPING_TIME * (speed - state[1])
        return [force * np.cos(state[2]), force * np.sin(state[2]), 0.0]

    return Keeper(3, wrench)


class SideBySide:
    """The diagram: the log's commands as a source, cars with perfect sensors, and a logger of what each would log.

    The sensors' effects (biases, latency) are part of a car, so that its rows compare with the log's.
    """

    def __init__(self, run: Run, cars: Mapping[str, CarModel]) -> None:
        """Args: cars: by name, the nominal one first.

        Raises:
            InvalidLogError: the car stands or spins all the time.
        """
        self._log, self.models = run, dict(cars)
        self._t = run.t - run.t[0]
        nominal = next(iter(cars.values())).parameters.single_track()
        self.motion: MeasuredMotion = measured_motion(run, nominal)
        self.driven, self._slowest = driven(run, nominal), slowest(nominal)
        self.remarks = list(self.motion.remarks)
        if not self.driven.any():
            raise InvalidLogError(
                f"{run.name}: the car stands (below {self._slowest:.1f} m/s for a car of this size) or spins "
                "throughout; log a drive"
            )
        builder = DiagramBuilder()
        self._follow = run.tau_cmd is None and run.omega_r is not None
        self._keep = run.tau_cmd is None and run.omega_r is None
        if self._follow:
            self.remarks.append("no tau_cmd: the cars' rear wheels follow the measured rim speed")
            self._wanted = self._source(builder, "rim_speed", self.motion.omega_r)
        elif self._keep:
            self.remarks.append("no tau_cmd and no omega_r: the cars roll freely, and a force keeps the measured speed")
            self._wanted = self._source(builder, "speed", run.v)
        self.cars: dict[str, Car] = {}
        self._loggers: dict[str, Any] = {}
        self._simulated = {name: model for name, model in cars.items() if isinstance(model.parameters, SimulatorCar)}
        for name, model in cars.items():
            if name not in self._simulated:
                self._add(builder, name, model)
        if not self.cars:  # a diagram has at least one system
            self._source(builder, "steering", run.delta_cmd)
        self.diagram = builder.Build()
        self.diagram.set_name("side_by_side")

    def _add(self, builder: DiagramBuilder, name: str, model: CarModel) -> None:
        """A car under the log's commands, on its road, and a logger of what it would log."""
        run, effects = self._log, model.effects
        torque = np.zeros(len(run)) if run.tau_cmd is None else run.tau_cmd
        given = as_commanded({"delta_cmd": run.delta_cmd, "tau_cmd": torque}, effects, run.period)
        if self._follow:  # it supplies the torque at the wheel: no lag comes between
            effects = effects._replace(torque_lag=0.0)
        single, force = model.parameters.single_track(), None
        if run.bank is not None:
            effects, force = bank_force(run.bank, single.mass, single.gravity, effects)
        made = Car(model.parameters, on_time(effects), noise=NoiseLevels.none(), period=run.period)
        car = self.cars[name] = builder.AddNamedSystem(name, made)
        steering, wrenches = self._source(builder, f"steering_of_{name}", given["delta_cmd"]), []
        if self._follow:
            follower = builder.AddNamedSystem(f"{name}_wheels", rim_speed_follower(model.parameters.single_track()))
            builder.Connect(car.GetOutputPort("state"), follower.GetInputPort("state"))
            builder.Connect(self._wanted, follower.GetInputPort("wanted"))
            driving = follower.get_output_port()
        else:
            driving = self._source(builder, f"torque_of_{name}", given["tau_cmd"])
        if self._keep:
            keeper = builder.AddNamedSystem(f"{name}_speed", speed_keeper(model.parameters.single_track()))
            builder.Connect(car.GetOutputPort("state"), keeper.GetInputPort("state"))
            builder.Connect(self._wanted, keeper.GetInputPort("wanted"))
            wrenches.append(keeper.get_output_port())
        if force is not None:
            none = np.zeros(len(run))
            wrenches.append(self._source(builder, f"bank_under_{name}", np.stack([none, force, none])))
        if wrenches:
            builder.Connect(self._sum(builder, name, wrenches), car.GetInputPort("disturbance"))
        builder.Connect(self._join(builder, f"{name}_commands", steering, driving), car.GetInputPort("command"))
        self._loggers[name] = add_logger(builder, car.GetOutputPort("log_row"), name, run.period)

    @staticmethod
    def _sum(builder: DiagramBuilder, name: str, wrenches: Sequence[Any]) -> Any:
        if len(wrenches) == 1:
            return wrenches[0]
        adder = builder.AddNamedSystem(f"{name}_wrench", Adder(len(wrenches), 3))
        for i, wrench in enumerate(wrenches):
            builder.Connect(wrench, adder.get_input_port(i))
        return adder.get_output_port()

    def _source(self, builder: DiagramBuilder, name: str, values: Array) -> Any:
        """A column of the log, or several [columns, rows], linear between rows."""
        trajectory = PiecewisePolynomial.FirstOrderHold(self._t, np.atleast_2d(values))
        return builder.AddNamedSystem(f"logged_{name}", TrajectorySource(trajectory)).get_output_port()

    @staticmethod
    def _join(builder: DiagramBuilder, name: str, steering: Any, torque: Any) -> Any:
        channels = {"steering": INPUTS[:1], "torque": INPUTS[1:]}
        joined = builder.AddNamedSystem(name, select_signals(channels, {"command": INPUTS}))
        builder.Connect(steering, joined.GetInputPort("steering"))
        builder.Connect(torque, joined.GetInputPort("torque"))
        return joined.get_output_port()

    def run(self, restart: float = 2.0) -> "Played":
        """Drives all cars, each put back onto the measured motion every `restart` [s] (0: only after a spin).

        A restart sets what the log measures; lags, heat and delayed commands stay as they are. A car that is lost (it
        spins or stops) has no rows until the next restart.

        Raises:
            InvalidLogError: a restart that is no time.
        """
        if not 0.0 <= restart < math.inf:
            raise InvalidLogError(f"--restart is {restart:g}; give seconds between restarts, or 0 for never")
        simulator = make_simulator(self.diagram, accuracy=ACCURACY)
        simulator.set_monitor(self._watch)
        context = simulator.get_mutable_context()
        window = np.full(len(self._t), -1)
        valid = {name: np.zeros(len(self._t), dtype=np.bool_) for name in self.cars}
        lost: dict[str, list[float]] = {name: [] for name in self.models}
        previous = -1
        stretches = windows(self.driven, round(restart / self._log.period))
        for number, (first, last) in enumerate(stretches):
            resumed = first == previous  # that row is the last prediction of the window before
            previous = last
            if not resumed:
                context.SetTime(self._t[first])
            for name in self.cars:
                self._place(context, name, first, settled=not resumed)
            if not resumed:
                simulator.Initialize()
            ends = self._advance(simulator, last)
            window[first + resumed : last + 1] = number
            for name in self.cars:
                # What a late sensor shows first is from before the start.
                late = 0 if resumed else round(sensor_delay(self.models[name].effects) / self._log.period)
                valid[name][first + resumed + late : ends.get(name, last + 1)] = True
                if name in ends:
                    lost[name].append(float(self._t[ends[name]]))
        cars = {name: self._rolled_out(name, stretches, window) if name in self._simulated
                else self._table(context, name, valid[name], window) for name in self.models}  # fmt: skip
        return Played(self._real(window), cars, lost, tuple(self.remarks))

    def _rolled_out(
        self, name: str, stretches: Sequence[tuple[int, int]], window: NDArray[np.int_]
    ) -> pd.DataFrame:  # fmt: skip
        model = self.models[name]
        assert isinstance(model.parameters, SimulatorCar)
        return rolled_out(self._log, self.motion, model.parameters, model.effects, stretches, window)

    def _place(self, context: Context, name: str, row: int, settled: bool) -> None:
        """Puts a car into the state measured at a row; `settled`: its lags and the like too."""
        plant = self.cars[name].plant
        own = plant.GetMyMutableContextFromRoot(context)
        (r, v, beta, omega_r), pose = self.motion.state(row, self._log.period, self.models[name].effects)
        # A late sensor's next rows may be of a spin already; no car starts lost.
        state = [r, max(v, self._slowest), float(np.clip(beta, -SPUN, SPUN)), omega_r]
        if settled:
            tau = 0.0 if self._log.tau_cmd is None else float(self._log.tau_cmd[row])
            plant.set_initial(own, [*state, 0.0, 0.0], pose=pose, actuation=(float(self._log.delta_cmd[row]), tau))
            return
        x = own.get_continuous_state_vector().CopyToVector()
        x[: len(state)], x[POSE_AT : POSE_AT + len(pose)] = state, pose
        own.SetContinuousState(x)

    def _is_lost(self, context: Context, name: str) -> bool:
        _, v, beta = (
            self.cars[name].plant.GetMyContextFromRoot(context).get_continuous_state_vector().CopyToVector()[:3]
        )
        return not (v >= LOST_SPEED * self._slowest and abs(beta) <= LOST_SIDESLIP)  # true for NaN, too

    def _watch(self, context: Context) -> EventStatus:
        if any(self._is_lost(context, name) for name in self.cars):
            return EventStatus.ReachedTermination(self.diagram, "a car is lost")
        return EventStatus.DidNothing()

    def _advance(self, simulator: Simulator, last: int) -> dict[str, int]:
        """Simulates up to a row; the first row without a prediction of each car that was lost on the way.

        A lost car is put back at once, so that the others can go on; what it does from there does not count.
        """
        context, ends = simulator.get_mutable_context(), dict[str, int]()
        while simulator.AdvanceTo(self._t[last]).reason() == SimulatorStatus.ReturnReason.kReachedTerminationCondition:
            row = min(int(np.searchsorted(self._t, context.get_time())), last)
            for name in self.cars:
                if self._is_lost(context, name):
                    ends.setdefault(name, row)
                    self._place(context, name, row, settled=True)
        return ends

    def _real(self, window: NDArray[np.int_]) -> pd.DataFrame:
        m = self.motion
        columns = {name: getattr(m, name) for name in ("x", "y", "psi", "r", "v", "beta", "omega_r")}
        columns |= {name: values for name in ("ax", "ay") if (values := self._log.column(name)) is not None}
        return pd.DataFrame({"t": self._t, **columns, "delta": self._log.delta_cmd, "window": window})

    def _table(self, context: Context, name: str, valid: NDArray[np.bool_], window: NDArray[np.int_]) -> pd.DataFrame:
        """A car's rows at the log's times, NaN where it has none."""
        data = self._loggers[name].FindLog(context).data()
        values = np.full((len(self._t), len(LOG_ROW)), np.nan)
        values[np.searchsorted(self._t, data[0] - 0.5 * self._log.period)] = data.T
        values[~valid] = np.nan
        table = pd.DataFrame(dict(zip(LOG_ROW, values.T, strict=True)))
        return table.assign(t=self._t, delta=self._log.delta_cmd, window=window)


class Played(NamedTuple):
    """What was driven: a row each row of the log in every table.

    Columns: t [s] from the log's start, x, y, psi, r, v, beta, omega_r, ax, ay, delta (SI; ax and ay of `real` only
    where logged), `window` (number of the restart that a row was predicted from; -1 where the real car stands or
    spins). Cars' rows are NaN where they were lost or not driven.
    """

    real: pd.DataFrame
    cars: dict[str, pd.DataFrame]
    lost: dict[str, list[float]]  # times [s] at which each car spun or stopped
    remarks: tuple[str, ...]


def windows(driven: NDArray[np.bool_], rows: int) -> list[tuple[int, int]]:
    """First and last rows of the stretches that are predicted in one go: at most `rows` after the first (0: no limit).

    Within a driven stretch each begins where the last one ended.
    """
    found = []
    for begin, end in spans(driven):
        step = rows if rows > 0 else len(driven)
        found += [(first, min(first + step, end - 1)) for first in range(begin, end - 1, step)]
    return found
