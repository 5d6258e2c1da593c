"""Effects of another package, found by entry points: plant, sensors, filter, diagnosis and command line know them.

Most tests run in processes of their own, since effects are found once. All but one run without numba, whose compilation
takes longer than what is tested.
"""

import json
from pathlib import Path

import pytest
from other_package import DELAYS, EFFECTS, WIND, install, install_package, refusal, run

from drift_drake.car.effects.installed import LOG_COLUMNS, installed_effects
from drift_drake.car.log.table import COLUMNS

PHYSICS = """
import numpy as np
from drift_drake import CATALOGUE, Effects, NoiseLevels, Run, VehicleParameters, VehiclePlant, make_effects
from drift_drake.drive.mpc.discrimination import RivalsStepModel
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.effects.magnitudes import measured, unbiased
from drift_drake.gap.estimation.windows import run_errors_of, windowed

car = VehicleParameters()

def rates(plant, psi):
    context = plant.CreateDefaultContext()
    plant.GetInputPort("actuation").FixValue(context, [0.0, 100.0])
    plant.set_initial(context, [0.0, 12.0, 0.0, 12.1, 0.0, 0.0], pose=(0.0, 0.0, psi), actuation=(0.0, 100.0))
    return plant.EvalTimeDerivatives(context).CopyToVector()[:10]

# Plants: at a heading of a quarter turn the wind blows against the course.
for make, mass in ((lambda q: VehiclePlant(car, q), car.mass), (lambda q: EquationsPlant(CARS["coupe"], q), None)):
    mass = mass or CARS["coupe"].mass
    still = make(make_effects({"gyro_scale": 0.001}))
    blown, limping = make(make_effects({"side_wind": 500.0})), make(make_effects({"limp_mode": 0.5}))
    change = rates(blown, np.pi / 2) - rates(still, np.pi / 2)
    np.testing.assert_allclose(change[1], -500.0 / mass, rtol=1e-6)
    assert rates(limping, 0.0)[3] < rates(still, 0.0)[3] - 1.0
assert VehiclePlant(car, make_effects({"side_wind": 500.0})).ToAutoDiffXd().has_internal_states

# A state: the torque rises as that of a first-order lag, and falls at once.
lag = 0.3
plant = VehiclePlant(car, make_effects({"turbo_lag": lag}))
assert plant.state_names[-1] == "turbo_lag"
context = plant.CreateDefaultContext()
plant.set_initial(context, [0.0, 12.0, 0.0, 12.1, 0.0, 0.0], actuation=(0.0, 100.0))
plant.GetInputPort("actuation").FixValue(context, [0.0, 160.0])
late = plant.EvalTimeDerivatives(context).CopyToVector()
np.testing.assert_allclose(late[-1], 60.0 / lag)
same = VehiclePlant(car, make_effects({"gyro_scale": 0.001}))
np.testing.assert_allclose(late[:10], rates(same, 0.0), rtol=1e-9, atol=1e-9)
plant.GetInputPort("actuation").FixValue(context, [0.0, 40.0])
assert plant.EvalTimeDerivatives(context).CopyToVector()[3] < late[3] - 1.0
try:
    EquationsPlant(CARS["coupe"], make_effects({"turbo_lag": lag}))
except ValueError as error:
    assert "turbo_lag" in str(error)

# Sensors, and back.
q = make_effects({"gyro_scale": 0.002, "gyro_bias": 0.01})
assert measured(0.1, 9.0, 0.0, 10.0, q)[0] == 0.1 + 0.01 + 0.02
np.testing.assert_allclose(unbiased(*measured(0.1, 9.0, 0.02, 10.0, q), q), [0.1, 9.0, 0.02, 10.0], atol=1e-12)

# A one-step model takes what has no heading, states included, and differentiates it.
EffectsStepModel(car, make_effects({"limp_mode": 0.3}))
model = EffectsStepModel(car, make_effects({"turbo_lag": lag}))
x = np.zeros((1, 15))
x[0, 1], x[0, 3], x[0, 14] = 12.0, 12.1, 100.0
u = np.array([[0.0, 160.0]])
x_next, by_x, by_u, by_u_next = model.linearize(x, u, u, np.zeros(1))
np.testing.assert_allclose(x_next[0, 14], 160.0 - 60.0 * np.exp(-0.1 / lag), rtol=1e-4)
np.testing.assert_allclose(by_x[0, 14, 14], np.exp(-0.1 / lag), rtol=1e-4)
np.testing.assert_allclose(by_u[0, 14, 1] + by_u_next[0, 14, 1], 1.0 - np.exp(-0.1 / lag), rtol=1e-4)
assert by_x[0, 3, 14] > 0.0
rivals = RivalsStepModel(EffectsStepModel(car, make_effects({"limp_mode": 0.3})), model, np.ones(6), np.zeros(6))
after = rivals.step(np.hstack([x, x[:, 6:]]), u, u, np.zeros(1))
np.testing.assert_allclose(after[0, 15:], x_next[0, 6:], rtol=1e-9, atol=1e-9)  # the rival's internal states
try:
    EffectsStepModel(car, make_effects({"side_wind": 300.0}))
except ValueError as error:
    assert "side_wind" in str(error)

# The filter: what a side wind does to a straight drive is small once it is known of.
from pydrake.systems.analysis import Simulator

def driven(plant, t):
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.GetInputPort("actuation").FixValue(context, [0.0, 100.0])
    plant.set_initial(context, [0.0, 15.0, 0.0, 15.1, 0.0, 0.0], pose=(0.0, 0.0, 0.0), actuation=(0.0, 100.0))
    states = []
    for time in t:
        simulator.AdvanceTo(time)
        states.append(context.get_continuous_state_vector().CopyToVector()[:10])
    return np.array(states) + np.random.default_rng(0).normal(size=(len(t), 10)) * 1e-3

def logged(t, x):
    return Run("run_0", t, x[:, 0], x[:, 1], np.zeros(len(t)), np.full(len(t), 100.0), x[:, 2], x[:, 3], x=x[:, 7],
               y=x[:, 8], psi=x[:, 9])

t, gust = 0.02 * np.arange(60), 1200.0
run = logged(t, driven(VehiclePlant(car, make_effects({"side_wind": gust})), t))
problem = make_problem([run], car)
theta = np.zeros(problem.nuisances)
without = filter_case(problem, theta, ())
known = filter_case(problem, np.append(theta, gust), ("side_wind",))
assert np.sum(known.innovations[0] ** 2) < 0.7 * np.sum(without.innovations[0] ** 2)

# The same of predictions of a double-track car.
t = 0.01 * np.arange(200)
run = windowed(logged(t, driven(EquationsPlant(CARS["coupe"], make_effects({"side_wind": gust})), t)))
constants = CARS["coupe"].constants()
known, without = run_errors_of(run, [(constants, make_effects({"side_wind": q})) for q in (gust, 0.0)])
assert np.abs(known[:, -1, 0]).max() < 0.2 * np.abs(without[:, -1, 0]).max()
print("all hold")
"""


def test_plants_sensors_and_filter_know_them(tmp_path: Path) -> None:
    install(tmp_path, EFFECTS)
    done = run(tmp_path, "-c", PHYSICS)
    assert done.stdout == "all hold\n", done.stderr


def test_the_command_line_knows_them(tmp_path: Path) -> None:
    install(tmp_path, EFFECTS | DELAYS)
    reported = run(tmp_path, "-m", "drift_drake", "effects", "--json", "effects.json").stdout
    line, *_ = (line for line in reported.splitlines() if line.startswith("side_wind"))
    assert line.split()[1:5] == ["N", "-1.5e+03", "to", "1.5e+03"]
    assert "Shown by straight stretches there and back:\n  side_wind" in reported
    assert "Shown by throttle steps:\n  engine_delay" in reported
    data = json.loads((tmp_path / "effects.json").read_text())
    assert data["engine_delay"]["installed"]
    assert data["engine_delay"]["delays"] == "tau_cmd"


def test_a_vehicle_file_may_have_them(tmp_path: Path) -> None:
    install(tmp_path, EFFECTS)
    program = """
import sys
from drift_drake import VehicleParameters, make_effects, read_vehicle, write_vehicle
write_vehicle("car.yaml", VehicleParameters(), make_effects({"side_wind": 300.0}))
assert read_vehicle("car.yaml")[1].side_wind == 300.0
write_vehicle("storm.yaml", VehicleParameters(), make_effects({"side_wind": 1e6}))
from drift_drake.cli.main import main
sys.exit(main(["simulate", "slalom", "--vehicle", "storm.yaml", "--out", "x.csv"]))
"""
    refused = run(tmp_path, "-c", program)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "storm.yaml: effects.side_wind is 1e+06 N" in refused.stderr


@pytest.mark.parametrize(
    ("effects", "says"),
    [
        ({"number": "WIND"}, "effect number (wind:WIND): cannot be imported"),
        ({"gust": "gust"}, "effect gust (wind:gust): is no drift_drake.Effect"),
        ({"half": "HALF"}, "a state needs both rate and start"),
        ({"endless": "ENDLESS"}, "its rate or start fails"),
        ({"early": "EARLY"}, "its range begins at -0.1 s; give a delay one above zero"),
        ({"needless": "NEEDLESS"}, "effect needless (wind:NEEDLESS): delays the torque; let it need its column"),
        ({"behind": "BEHIND"}, "delays 'delta_cmd' at stage 'actuator' with no functions; let a delay be of"),
        ({"always": "BROKEN"}, "its force gives (1.0, 0.0, 0.0) at a magnitude of zero"),
        ({"lambda": "SIDE_WIND"}, "its name is no name of a variable"),
        ({"none": "SIDE_WIND"}, "none is a verdict or in vehicle files"),
        ({"unknown": "SIDE_WIND"}, "unknown is a verdict or in vehicle files"),
        ({"mass": "SIDE_WIND"}, "mass is a verdict or in vehicle files"),
    ],
)
def test_one_that_cannot_be_used_is_named(tmp_path: Path, effects: dict[str, str], says: str) -> None:
    install(tmp_path, effects)
    said = refusal("wind", tmp_path, installed_effects.__wrapped__)
    assert says in said
    assert "\n" not in said


@pytest.mark.parametrize(
    ("effects", "says"),
    [
        ({"storm": "STORM"}, "effect storm (wind:STORM): cannot be imported"),
        ({"aero_drag": "SIDE_WIND"}, "effect aero_drag: is in the catalogue already"),
    ],
)
def test_the_command_line_says_so_in_one_sentence(tmp_path: Path, effects: dict[str, str], says: str) -> None:
    install(tmp_path, effects)
    done = run(tmp_path, "-m", "drift_drake", "effects")
    assert (done.returncode, done.stdout) == (2, "")
    assert says in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ("low=float('nan')", "low is nan; give a finite number"),
        ("low='a'", "low is 'a'; give a finite number"),
        ("high=float('inf')", "high is inf; give a finite number"),
        ("high=10**400", "high is 1000"),
        ("low=5.0", "its range is 5 to 1"),
        ("low=0.0, high=0.0", "its range is 0 to 0"),
        ("daily=0.0", "daily 0"),
        ("unit=None", "unit is None; give a text"),
        ("needs=('nothing',)", "needs is ('nothing',); give a tuple of some of x, y, psi"),
        ("needs='psi'", "needs is 'psi'; give a tuple"),
        ("remembers=('r',)", "remembers is ('r',)"),
        ("force=7", "force is 7; give a function"),
        ("limit=1", "limit is 1; give True or False"),
        ("fitted=('always',)", "fitted is ('always',); give a tuple of some of further, drives, alone, double_track"),
        ("drawn=(0.0, 1.0)", "drawn is (0.0, 1.0); give a Distribution"),
        ("double_track='parameter'", "double_track is 'parameter'; give 'effect' or 'nothing'"),
        ("scales='x', force=None, stage='sensor'", "scales is 'x'; give one of r, v, beta, omega_r"),
        ("late=True", "hastens commands or delays readings; use the catalogue's own"),
        ("force=lambda *a: (0.0, a[-1])", "at a magnitude of zero; let it give|let it give 3 finite numbers"),
        ("force=lambda *a: (0.0, a[-1] * 1e309, 0.0)", "let it give 3 finite numbers"),
        ("force=lambda *a: 0.0", "its force fails (TypeError"),
        (
            "force=lambda *a: (0.0, 1.0 / a[-1] if a[-1] else 0.0, 0.0 if a[0] < 0.5 else {}['no'])",
            "its force fails (KeyError",
        ),
        ("force=lambda *a: exit()", "its force fails (SystemExit"),
    ],
)
def test_a_record_or_physics_with_a_flaw_is_named(tmp_path: Path, changes: str, says: str) -> None:
    source = "from dataclasses import replace\nfrom drift_drake import Effect\n"
    source += "GUST = Effect('N', -1.0, 1.0, 'a gust', force=lambda r, v, beta, omega_r, psi, car, q: (0.0, q, 0.0))\n"
    install_package(tmp_path, "flawed", source + f"FLAWED = replace(GUST, {changes})\n", "effects", {"gust": "FLAWED"})
    said = refusal("flawed", tmp_path, installed_effects.__wrapped__)
    assert said.startswith("effect gust (flawed:FLAWED): ")
    assert any(words in said for words in says.split("|"))
    assert "\n" not in said


def test_an_error_that_scales_a_reading_needs_no_function(tmp_path: Path) -> None:
    source = "from drift_drake import Effect\nGAIN = Effect('-', -0.1, 0.1, 'yaw rate', 'sensor', scales='r')\n"
    install_package(tmp_path, "gains", source, "effects", {"gain": "GAIN"})
    asked = """
from drift_drake.car.effects.magnitudes import make_effects, measured, unbiased
from drift_drake.car.sensor_errors import SENSORS
wrong = make_effects({"gain": 0.25, "gyro_gain_error": 0.25})
assert measured(1.0, 2.0, 3.0, 4.0, wrong) == (1.5, 2.0, 3.0, 4.0)
assert unbiased(1.5, 2.0, 3.0, 4.0, wrong) == (1.0, 2.0, 3.0, 4.0)
assert SENSORS[-1] == "gain"
"""
    done = run(tmp_path, "-c", asked)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("source", ["import sys\nsys.exit(0)\n", "raise KeyError('no')\n", "raise GeneratorExit\n"])
def test_a_package_that_ends_python_is_named(tmp_path: Path, source: str) -> None:
    install_package(tmp_path, "ending", source, "effects", {"gust": "GUST"})
    assert "effect gust (ending:GUST): cannot be imported (" in refusal(
        "ending", tmp_path, installed_effects.__wrapped__
    )


def test_standard_output_is_the_commands_own(tmp_path: Path) -> None:
    install_package(tmp_path, "wind", WIND + "print('hello')\n", "effects", EFFECTS)
    assert "side_wind" in json.loads(run(tmp_path, "-m", "drift_drake", "effects", "--json", "-").stdout)


def test_physics_that_numba_cannot_compile_are_named_before_anything_begins(tmp_path: Path) -> None:
    source = WIND.replace("    return -magnitude", "    import os\n    return -magnitude", 1)
    install_package(tmp_path, "wind", source, "effects", EFFECTS)
    refused = run(tmp_path, "-m", "drift_drake", "effects", jit=True)
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (2, "", 1)
    assert "effect side_wind: numba cannot compile its force (" in refused.stderr


@pytest.mark.parametrize("force", ["magnitude if v > 5.0 else 0.0", "math.tanh(v) * magnitude"])
def test_physics_that_do_not_compute_several_cars_at_once_are_named(tmp_path: Path, force: str) -> None:
    source = f"""
import math
from drift_drake import Effect
WIND = Effect("N", 0.0, 900.0, "a force", shown_by="a straight",
              force=lambda r, v, beta, omega_r, psi, car, magnitude: (0.0, {force}, 0.0))
"""
    install_package(tmp_path, "wind", source, "effects", {"side_wind": "WIND"})
    refused = run(tmp_path, "-m", "drift_drake", "effects", jit=True)
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (2, "", 1)
    assert "effect side_wind: numba cannot compile its force (" in refused.stderr
    assert "select in place of if" in refused.stderr


def test_columns_that_an_effect_may_need_are_those_of_logs() -> None:
    assert set(LOG_COLUMNS) == set(COLUMNS) - {"t"}


DIAGNOSED = """
import sys
import numpy as np
from drift_drake import VehicleParameters, write_vehicle, write_run, Effects
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth
car = VehicleParameters()
for run in make_case(Truth({sys.argv[1]: float(sys.argv[2])}, {}, {"friction": 0.01}), car, np.random.default_rng(2)):
    write_run(run, f"logs/{run.name}.csv")
car.to_yaml("car.yaml")
"""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "magnitude"), [("side_wind", 900.0), ("turbo_lag", 0.25), ("engine_delay", 0.1)])
def test_a_diagnosis_names_one(tmp_path: Path, name: str, magnitude: float) -> None:
    """Compiled: what a user gets."""
    install(tmp_path, EFFECTS | {"engine_delay": DELAYS["engine_delay"]})
    (tmp_path / "logs").mkdir()
    made = run(tmp_path, "-c", DIAGNOSED, name, str(magnitude), jit=True)
    assert made.returncode == 0, made.stderr
    reported = run(tmp_path, "-m", "drift_drake", "diagnose", "logs", "--vehicle", "car.yaml", "--quiet", jit=True)
    assert reported.stdout.startswith(f"logs: {name} "), reported.stdout + reported.stderr
    assert float(reported.stdout.split()[2]) == pytest.approx(magnitude, rel=0.1)
