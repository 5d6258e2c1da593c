"""The real car of a simulation: actuators' delay, plant and sensors as one diagram."""

from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort

from drift_drake.car.effects.delays import check_causal, command_delays
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.known_car import plant_of_car
from drift_drake.car.on_path import PLANT_STATES
from drift_drake.car.parameters import CarParameters
from drift_drake.car.path_plant import CurvedPath, PathPlant
from drift_drake.car.sensors import PARTS, NoiseLevels, Sensors, TransportDelay
from drift_drake.car.single_track.motion import INPUTS
from drift_drake.car.vehicle_file import check_effects, check_plausible
from drift_drake.common.selector import select_signals


class Car(Diagram):
    """What stands for the real car: command in, measurements out, with every effect of the catalogue at its place.

    Put it into a state with `car.plant.set_initial(...)` and seed its noise with `car.sensors.set_seed(...)`.

    Input ports:
        command: (delta [rad], tau [N m]); each passes the transport delays of its effects.
        disturbance, curvature (optional): see `VehiclePlant`.

    Output ports:
        measured_state: (r, v, beta, omega_r, e, dphi, s); log_row: see `drift_drake.car.sensors`.
        state, path_position, pose, acceleration: the truth; see `VehiclePlant`.

    Args:
        parameters: the car without effects.
        effects: magnitudes, zero for none.
        path: see `VehiclePlant`.
        noise: of the sensors.
        period: of the sensors' sampling, and of the rows of the transport delays [s].
        plant: another plant of the same ports in place of the parameters' own; of `effects`,
            delays and sensors' effects still act here.

    Raises:
        InvalidVehicleError: a parameter or an effect that no car has, or commands that act before they are given.

    Examples:
        >>> Car(car, make_effects({"steering_lag": 0.1})).GetOutputPort("measured_state").size()
        7
    """

    def __init__(
        self,
        parameters: CarParameters,
        effects: Effects = Effects(),
        path: CurvedPath | None = None,
        noise: NoiseLevels = NoiseLevels(),
        period: float = 0.01,
        plant: PathPlant | None = None,
    ) -> None:
        Diagram.__init__(self)
        check_plausible(parameters.single_track(), "the car")
        check_effects(effects, parameters.single_track(), "the car")
        check_causal(effects, "the car")
        builder = DiagramBuilder()
        self.plant = builder.AddNamedSystem(
            "plant", plant_of_car(parameters, effects, path) if plant is None else plant
        )
        self.sensors = builder.AddNamedSystem("sensors", Sensors(noise, effects, period))
        actuation = self.plant.GetInputPort("actuation")
        delays = command_delays(effects)
        if any(delays):
            channels = {"steering": INPUTS[:1], "torque": INPUTS[1:]}
            split = builder.AddNamedSystem("command", select_signals({"command": INPUTS}, channels))
            joined = builder.AddNamedSystem("actuation", select_signals(channels, {"actuation": INPUTS}))
            builder.ExportInput(split.get_input_port(), "command")
            for channel, late in zip(channels, delays, strict=True):
                command = split.GetOutputPort(channel)
                if late != 0.0:
                    delay = builder.AddNamedSystem(f"{channel}_delay", TransportDelay(1, late, period))
                    builder.Connect(command, delay.get_input_port())
                    command = delay.get_output_port()
                builder.Connect(command, joined.GetInputPort(channel))
            builder.Connect(joined.get_output_port(), actuation)
        else:
            builder.ExportInput(actuation, "command")
        for name in ("disturbance", "curvature"):
            builder.ExportInput(self.plant.GetInputPort(name), name)
        truth = self._state_parts(builder) | {"acceleration": self.plant.GetOutputPort("acceleration")}
        for name, port in truth.items():
            builder.Connect(port, self.sensors.GetInputPort(name))
            builder.ExportOutput(port, name)
        for name in ("measured_state", "log_row"):
            builder.ExportOutput(self.sensors.GetOutputPort(name), name)
        builder.BuildInto(self)

    def _state_parts(self, builder: DiagramBuilder) -> dict[str, OutputPort]:
        """The plant's ports of these names, taken out of its whole state by Drake, which calls no Python for them."""
        whole = self.plant.GetOutputPort("full_state")
        own = [f"own_{k}" for k in range(whole.size() - len(PLANT_STATES))]
        wanted = {name: PARTS[name] for name in ("state", "path_position", "pose")}
        parts = select_signals({"full_state": (*PLANT_STATES, *own)}, wanted)
        builder.AddNamedSystem("state_parts", parts)
        builder.Connect(whole, parts.get_input_port())
        return {name: parts.GetOutputPort(name) for name in wanted}
