"""Prediction errors of a simulator of the user's against those of the compiled equations, for the same car."""

import dataclasses
import multiprocessing
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.car_file import read_car
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.foreign.pool import cost_of, end_workers
from drift_drake.car.foreign.rollouts import SimulatorError
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.effort import affordable, counted, derivatives_of
from drift_drake.gap.estimation.windows import WindowedRun, errors, errors_of_all, windowed
from tests.car.foreign.bicycle import DATA, simulate, straight_on, written
from tests.car.foreign.bicycle import PARAMETERS as PARAMETERS_OF_BICYCLE

TWIN = """
import numpy as np

from drift_drake.car.effects.magnitudes import NO_INTERNAL_STATES, Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion_with_effects import motion_with_effects


def simulate(start, inputs, dt, parameters, steps=4):
    p = VehicleParameters(**parameters).constants()
    z = [start["r"], start["v"], start["beta"], start["omega"]]
    h, out = dt / steps, [z]

    def rates(z, u):
        m, _ = motion_with_effects(*z, 0.0, NO_INTERNAL_STATES, u[0], u[1], p, Effects(), *u[2:])
        return [m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot]

    for row in range(inputs["delta"].shape[1] - 1):
        for step in range(steps):
            u, w, q = ([c[:, row] + s * (c[:, row + 1] - c[:, row]) for c in inputs.values()]
                       for s in (step / steps, (step + 0.5) / steps, (step + 1) / steps))
            k = rates(z, u)
            k2 = rates([a + 0.5 * h * b for a, b in zip(z, k)], w)
            k3 = rates([a + 0.5 * h * b for a, b in zip(z, k2)], w)
            k4 = rates([a + h * b for a, b in zip(z, k3)], q)
            z = [a + h / 6.0 * (b + 2.0 * c + 2.0 * d + e) for a, b, c, d, e in zip(z, k, k2, k3, k4)]
        out.append(z)
    return dict(zip(("r", "v", "beta", "omega"), np.moveaxis(np.array(out), 0, -1)))
"""
PARAMETERS = ("mass", "yaw_inertia", "front_axle_distance", "rear_axle_distance", "friction", "front_stiffness",
              "rear_stiffness", "rear_axle_inertia")  # fmt: skip


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory):
    """The single-track car of the defaults as a simulator of the user's."""
    folder = tmp_path_factory.mktemp("twin")
    (folder / "twin.py").write_text(TWIN)
    car = VehicleParameters()
    outputs = {"r": "r", "v": "v", "beta": "beta", "omega_r": "omega"}
    path = written(
        folder, inputs={"steering": "delta", "torque": "tau", "force_x": "fx", "force_y": "fy", "yaw_moment": "mz"},
        outputs=outputs, start=outputs, parameters={name: getattr(car, name) for name in PARAMETERS},
        meaning={name: name for name in PARAMETERS}, unknown={}, python="twin:simulate",
    )  # fmt: skip
    data = path.read_text().replace(str(Path(__file__).parents[2] / "car" / "foreign"), str(folder))
    head, _, _ = data.partition("\ncar:")
    car.to_yaml(folder / "car.yaml")
    path.write_text(head + "\ncar: car.yaml\n")
    yield read_car(path)[0]
    end_workers()


T = 0.01 * np.arange(260)
COMMANDS = {"delta": 0.06 * np.sin(2.2 * T)[None], "tau": 60.0 + 60.0 * np.sin(1.3 * T)[None]}
NO_FORCE = dict.fromkeys(("fx", "fy", "mz"), 0.0 * T[None])


def windows_of(r: np.ndarray, v: np.ndarray, beta: np.ndarray, omega_r: np.ndarray) -> list[WindowedRun]:
    """A run of this motion, each [rows]."""
    psi = np.concatenate([[0.0], np.cumsum(0.005 * (r[1:] + r[:-1]))])
    delta, tau = (values[0] for values in COMMANDS.values())
    return [windowed(Run("one", t=T, r=r, v=v, beta=beta, omega_r=omega_r, psi=psi, delta_cmd=delta, tau_cmd=tau))]


@pytest.fixture(scope="module")
def runs() -> list[WindowedRun]:
    """Windows of the twin's own motion."""
    module: dict = {}
    exec(TWIN, module)
    car = VehicleParameters()
    start = {"r": np.zeros(1), "v": np.full(1, 13.0), "beta": np.zeros(1), "omega": np.full(1, 13.1)}
    found = module["simulate"](start, COMMANDS | NO_FORCE, 0.01, {name: getattr(car, name) for name in PARAMETERS})
    return windows_of(*(found[name][0] for name in ("r", "v", "beta", "omega")))


def test_the_same_car_has_the_same_errors(twin, runs) -> None:
    ours, theirs = (errors(runs, car.constants(), Effects()) for car in (VehicleParameters(), twin))
    assert max(np.abs(ours).max(), np.abs(theirs).max()) < 1e-5  # on the twin's own motion, from smoothed starts


EXACT = {
    "mass_error": 0.1, "yaw_inertia_error": 0.3, "cg_shift": 0.08, "friction_level": -0.3,
    "front_stiffness_error": -0.3,
    "rear_stiffness_error": 0.2, "drivetrain_inertia_error": 0.5, "torque_gain_error": -0.2, "steering_lag": 0.1,
    "steering_delay": 0.07, "steering_rate_limit": 0.05, "steering_offset": 0.02, "steering_ratio_error": 0.2,
    "torque_lag": 0.2, "command_clock_error": 0.05, "gyro_bias": 0.03, "sideslip_bias": 0.02,
    "wheel_radius_error": 0.03,
    "gyro_gain_error": 0.08, "speed_gain_error": 0.01, "sensor_latency": 0.06,
}  # fmt: skip
ALONG = {"aero_drag": 1.5, "rolling_resistance": 0.04, "road_grade": 0.05, "road_bank": 0.1,
         "differential_yaw_moment": 150.0, "drivetrain_friction": 200.0, "power_limit": 15.0}  # fmt: skip
"""Taken along the measured motion, where the equations take them along the predicted one."""


@pytest.mark.parametrize("name", [*EXACT, *ALONG])
def test_an_effect_does_to_a_simulator_what_it_does_to_the_equations(twin, runs, name: str) -> None:
    q = make_effects({name: (EXACT | ALONG)[name]})
    ours = errors(runs, VehicleParameters().constants(), q) - errors(runs, VehicleParameters().constants(), Effects())
    theirs = errors(runs, twin.constants(), q) - errors(runs, twin.constants(), Effects())
    size = np.sqrt(np.mean(ours**2, axis=(0, 1)))
    apart = np.sqrt(np.mean((ours - theirs) ** 2, axis=(0, 1)))
    assert np.max(size) > 0.0
    assert np.all(apart <= (0.002 if name in EXACT else 0.12) * size + 1e-5 * np.max(size) + 1e-7)


def test_cars_that_are_asked_for_together_are_those_one_by_one(tmp_path: Path, runs) -> None:
    """Those with the same parameters share their roll-outs' calls, whatever is done round them."""
    car, _ = read_car(written(tmp_path))
    effects = [make_effects({name: 0.05}) for name in ("steering_lag", "mass_error", "gyro_bias", "steering_delay")]
    together = errors_of_all(runs, [(car.constants(), q) for q in effects])
    for q, found in zip(effects, together, strict=True):
        np.testing.assert_array_equal(found, errors(runs, car.constants(), q))
    assert np.abs(together[0] - together[3]).max() > 1e-4


def test_derivatives_of_a_simulator_are_taken_over_ten_times_as_much(tmp_path: Path) -> None:
    car, _ = read_car(written(tmp_path, windows=100))  # which makes it slow
    assert derivatives_of(car.constants()) == (0.2, 0.1)
    assert derivatives_of(VehicleParameters().constants()) == (0.0, 0.01)


def test_what_fails_is_the_largest_error_and_counted(tmp_path: Path, runs) -> None:
    car, _ = read_car(written(tmp_path, "raises"))
    heavy = car.simulator.changed_constants(car.constants(), make_effects({"mass_error": 0.2}))
    assert np.all(np.abs(errors(runs, car.constants(), Effects())) < 10.0)
    assert np.all(errors(runs, heavy, Effects())[..., :3] == 1e3)
    cost = cost_of(car.simulator)
    assert cost.failed > 0
    assert "ValueError: the matrix is singular" in cost.sentence()


def test_a_lead_in_lets_what_cannot_be_set_settle(tmp_path: Path) -> None:
    """Sideslip that cannot be set: with a lead-in predictions begin where it is measured."""
    start = {"v_x": "vx", "r": "r", "omega_r": {"name": "w", "unit": "rad/s"}}
    led, _ = read_car(written(tmp_path, "starts_straight", start=start, lead_in=0.3, name="led.yaml"))
    rest, _ = read_car(written(tmp_path, "starts_straight", start=start | {"v_y": "vy"}, name="rest.yaml"))
    at = {"r": np.zeros(1), "vx": np.full(1, 13.0), "vy": np.zeros(1), "w": np.full(1, 13.0 / 0.32)}
    given = {"steer": COMMANDS["delta"], "torque": 8.0 * COMMANDS["tau"]}
    found = {name: values[0] for name, values in simulate(at, given, 0.01, PARAMETERS_OF_BICYCLE).items()}
    own = windows_of(found["r"], np.hypot(found["vx"], found["vy"]), np.arctan2(found["vy"], found["vx"]),
                     0.32 * found["w"])  # fmt: skip
    near, far = (np.sqrt(np.mean(errors(own, car.constants(), Effects())[..., [0, 2]] ** 2)) for car in (led, rest))
    assert near < 0.4 * far


def test_a_lead_in_gives_the_measured_motion_to_follow(tmp_path: Path) -> None:
    """A simulator that puts out what it is given to follow predicts what is measured, but for the starts' smoothing."""
    led = {"lead_in_r": "led_r", "lead_in_v_x": "led_vx", "lead_in_v_y": "led_vy",
           "lead_in_omega_r": {"name": "led_w", "unit": "rad/s"}}  # fmt: skip
    path = written(tmp_path, "echoes", lead_in=0.3, inputs=DATA["simulator"]["inputs"] | led)
    r, v, beta, omega_r = 0.4 * np.sin(3.0 * T), 12.0 + 0.5 * T, 0.1 * np.cos(2.0 * T), 12.5 + 0.4 * T
    (run,) = windows_of(r, v, beta, omega_r)
    found = errors([run], read_car(path)[0].constants(), Effects())
    rows = run.starts[:, None] + run.stride_rows * np.arange(1, found.shape[1] + 1)
    np.testing.assert_allclose(found[..., :4], (run.y - run.start_y)[rows][..., :4], atol=2e-4)
    assert np.ptp(r) > 0.5


def test_progress_counts_roll_outs(tmp_path: Path, runs) -> None:
    car, _ = read_car(written(tmp_path))
    said: list[str] = []
    with counted(lambda stage, _share: said.append(stage), car.constants()) as tell:
        tell("one", 0.0)
        errors(runs, car.constants(), Effects())
        tell("two", 0.5)
    count = len(runs[0].starts)
    assert said == ["one: 0 roll-outs", f"one: {count} roll-outs", f"two: {count} roll-outs, some {count:.1g} left"]
    with counted(lambda stage, _share: said.append(stage), VehicleParameters().constants()) as tell:
        tell("three", 0.5)
    assert said[-1] == "three"


def test_a_daemon_may_ask_for_roll_outs(tmp_path: Path) -> None:
    """As a cluster's worker is one."""
    daemon = multiprocessing.get_context("spawn").Process(target=straight_on, args=(written(tmp_path),), daemon=True)
    daemon.start()
    daemon.join(120.0)
    assert daemon.exitcode == 0


def test_slow_simulators_are_asked_for_fewer_windows(tmp_path: Path, runs, monkeypatch: pytest.MonkeyPatch) -> None:
    assert affordable(VehicleParameters().constants(), runs, 450) == 450
    car, _ = read_car(written(tmp_path))
    assert affordable(car.constants(), runs, 50) == 50
    pinned, _ = read_car(written(tmp_path, windows=60, name="pinned.yaml"))
    assert affordable(pinned.constants(), runs, 450) == 60
    monkeypatch.setattr("drift_drake.gap.estimation.effort.EVALUATION", 0.0)
    assert affordable(car.constants(), runs, 450) == 100


def test_logs_without_torque_are_refused(twin, runs) -> None:
    with pytest.raises(SimulatorError, match=r"one: has no tau_cmd, .*; log the torque, or give"):
        errors([dataclasses.replace(run, fed=True) for run in runs], twin.constants(), Effects())
