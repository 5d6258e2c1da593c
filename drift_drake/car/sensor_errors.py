"""Errors of sensors that are known, taken off the readings."""

from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.delays import LATE
from drift_drake.car.effects.magnitudes import Effects, unbiased
from drift_drake.car.sensors import MEASURED_STATE
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output

SENSORS = tuple(name for name, effect in CATALOGUE.items() if effect.stage == "sensor" and not effect.late)
"""Errors that a reading can lose at once."""


def sensor_errors(effects: Effects) -> Effects:
    """Of effects the sensors' errors and latency alone."""
    return Effects(**{name: getattr(effects, name) for name in (*SENSORS, *LATE)})


def corrected_reading(measured: Array, errors: Effects) -> Array:
    """A measured state [7] without its sensors' errors; the course takes over the sideslip's."""
    y = measured.copy()
    y[:4] = unbiased(*y[:4], errors)
    y[MEASURED_STATE.index("dphi")] += y[2] - measured[2]
    return y


class SensorCorrection(LeafSystem):
    """Input port: measured_state [7]. Output port: corrected_state [7]; see `corrected_reading`. No state."""

    def __init__(self, errors: Effects) -> None:
        super().__init__()
        measured = self.DeclareVectorInputPort("measured_state", len(MEASURED_STATE))
        declare_output(
            self, "corrected_state", len(MEASURED_STATE),
            lambda context: corrected_reading(measured.Eval(context), errors), {measured.ticket()},
        )  # fmt: skip


def without_errors(builder: DiagramBuilder, measured_state: OutputPort, errors: Effects) -> OutputPort:
    """The port of a measured state without its sensors' errors: the same port where there are none."""
    if not any(getattr(errors, name) for name in SENSORS):
        return measured_state
    correction = builder.AddNamedSystem("sensor_correction", SensorCorrection(errors))
    builder.Connect(measured_state, correction.get_input_port())
    return correction.get_output_port()
