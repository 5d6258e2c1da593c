"""Errors of sensors that are known: taken off the readings, alone and in the loop."""

import dataclasses

import numpy as np

from drift_drake.car.effects.magnitudes import Effects, make_effects, measured
from drift_drake.car.internal_states import on_the_motion
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensor_errors import SensorCorrection, corrected_reading, sensor_errors
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.reference.trajectory import figure_8

ERRORS = make_effects(
    {"gyro_bias": 0.02, "sideslip_bias": -0.03, "wheel_radius_error": 0.04, "gyro_gain_error": 0.05,
     "speed_gain_error": -0.03}
)  # fmt: skip
TRUE = np.array([0.5, 11.0, -0.4, 14.0, 0.1, 0.05, 3.0])


def _reading() -> np.ndarray:
    reading = TRUE.copy()
    reading[:4] = measured(*TRUE[:4], ERRORS)
    reading[5] += ERRORS.sideslip_bias
    return reading


def test_a_reading_loses_its_sensors_errors() -> None:
    np.testing.assert_allclose(corrected_reading(_reading(), ERRORS), TRUE, rtol=1e-12)
    assert not any(on_the_motion(ERRORS))
    late = ERRORS._replace(sensor_latency=0.05)  # over which a reading is run on (`car.latency`)
    assert sensor_errors(late._replace(mass_error=0.1)) == late
    np.testing.assert_array_equal(corrected_reading(_reading(), late), corrected_reading(_reading(), ERRORS))


def test_the_system_is_the_function() -> None:
    system = SensorCorrection(ERRORS)
    context = system.CreateDefaultContext()
    system.get_input_port().FixValue(context, _reading())
    np.testing.assert_allclose(system.get_output_port().Eval(context), TRUE, rtol=1e-12)
    assert system.HasDirectFeedthrough(0, 0)
    assert context.num_total_states() == 0


def test_a_loop_that_knows_its_sensors_errors_drives_as_one_without_them() -> None:
    parameters = VehicleParameters()
    reference, control = (
        dataclasses.replace(figure_8(parameters), distance=40.0),
        ControlConfig(horizon=12, period=0.05),
    )
    errors = Effects(sideslip_bias=0.03, gyro_bias=0.02)

    def rms_e(true: Effects, known: Effects) -> float:
        loop = ClosedLoop(parameters, reference, NominalStepModel(parameters), true, control=control,
                          sensor_errors=known)  # fmt: skip
        run = loop.run(loop.initial_context(seed=0))
        assert run.outcome == "completed"
        return run.metrics().rms_e

    right, known, unknown = rms_e(Effects(), Effects()), rms_e(errors, errors), rms_e(errors, Effects())
    assert known < 1.1 * right
    assert unknown > 2.0 * right
