"""`drift-drake simulator check` names each mistake that is put into a simulator, and none in a good one."""

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from drift_drake.car.car_file import read_car, read_simulator_car
from drift_drake.car.foreign.check import check_simulator
from drift_drake.car.foreign.led_in import lead_in_needed, led_in
from drift_drake.car.foreign.pool import cost_of, end_workers, roll_all
from drift_drake.car.foreign.rollouts import SimulatorError, function_of
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.main import main
from tests.car.foreign.bicycle import DATA, PARAMETERS, written

INPUTS, OUTPUTS = DATA["simulator"]["inputs"], DATA["simulator"]["outputs"]


@pytest.fixture(scope="module", autouse=True)
def _ended() -> Iterator[None]:
    yield
    end_workers()


def checked(path: Path):
    car, _ = read_car(path)
    assert isinstance(car, SimulatorCar)
    return check_simulator(car)


def test_nothing_is_wrong_with_a_good_one(tmp_path: Path) -> None:
    found = checked(written(tmp_path))
    assert [one.sentence for one in found.findings if one.grade != "good"] == []
    assert 0.0 < found.seconds_per_rollout < 0.5


MISTAKES = {
    "other sign": ("other_sign", {}, r"steering moves r by -\d.* times .*; give sign: -1"),
    "sign in the file": ("simulate", {"outputs": OUTPUTS | {"r": {"name": "r", "sign": -1}}},
                         r"r begins at -1 times what is measured \(the other sign\)"),
    "degrees": ("degrees", {}, r"r begins at 57\.3 times what is measured \(degrees for radians\)"),
    "takes degrees": ("takes_degrees", {}, r"steering moves r by 0\.017\d* times .* \(radians for degrees\)"),
    "psi in degrees": ("psi_in_degrees", {}, r"psi turns 57\.3 times as far as r says \(degrees for radians\)"),
    "rpm": ("simulate", {"outputs": OUTPUTS | {"omega_r": {"name": "w", "unit": "rpm"}}},
            r"omega_r begins at 0\.105 times .*\(rad/s for rpm\)"),
    "no gear ratio": ("simulate", {"inputs": INPUTS | {"torque": "torque"}}, r"torque moves v by 0\.1\d* times"),
    "cannot be set": ("starts_at_rest", {}, r"r cannot be set: its start value changes nothing; .* lead_in: 0\.3"),
    "step": ("coarse", {}, r"half the step of 10 ms changes the motion by .*: it is too long; give step: 0\.0025"),
    "one step": ("one_step", {}, r"half the step of 10 ms fails: .*made for 10 ms alone"),
    "lag": ("late", {}, r"output psi comes 40 ms later than r: it lags"),
    "after the step": ("after_the_step", {}, r"output shows its start value|v shows its start value 1 rows late"),
    "random": ("random", {}, r"the same roll-out came out different .*: it draws random numbers, or keeps state"),
    "keeps state": ("keeps_state", {}, r"the same roll-out came out different"),
    "raises": ("raises", {}, r"with m of 1740 it fails \(ValueError: the matrix is singular\)"),
    "does nothing": ("nothing", {}, r"J changes nothing in a turn under power"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named(tmp_path: Path, mistake: str) -> None:
    function, changes, said = MISTAKES[mistake]
    found = checked(written(tmp_path, function, **changes))
    sentences = [one.sentence for one in found.findings if one.grade != "good"]
    assert any(re.search(said, sentence) for sentence in sentences), sentences


def test_states_that_a_start_cannot_set_ask_for_a_lead_in(tmp_path: Path) -> None:
    """Wheels that lag 0.12 s and begin straight: lost in 0.2 s of lead-in to a fifth, in 0.8 s to a thousandth."""
    slow = PARAMETERS | {"soft": 0.12}
    with_none = checked(written(tmp_path, "starts_centred", parameters=slow))
    said = [one.sentence for one in with_none.findings if one.grade != "good"]
    (found,) = (re.search(r"off by ([\d.]+) % of their change; ([\d.]+) % with lead_in: ([\d.]+)", s) for s in said)
    assert found is not None
    off, then, lead = map(float, found.groups())
    assert off > 10.0
    assert then < 2.0
    assert 0.4 <= lead <= 0.8
    with_one = checked(written(tmp_path, "starts_centred", parameters=slow, lead_in=lead, name="led.yaml"))
    assert [one.sentence for one in with_one.findings if one.grade != "good"] == []


def test_a_small_car_asks_for_a_lead_in_as_much_shorter_as_it_moves_faster(tmp_path: Path) -> None:
    """Froude's scaling to a wheelbase of 0.1 m, of which a metre is the full size: times by the root of 0.1."""
    share, length, mass = 0.1**0.5, 0.1 / 2.5, 3.0 / PARAMETERS["m"]
    small = PARAMETERS | {"m": 3.0, "lf": 1.2 * length, "lr": 1.3 * length, "J": 2200.0 * mass * length**2}
    small |= {name: PARAMETERS[name] * mass for name in ("cf", "cr", "jw")} | {"soft": 0.12 * share}
    data = yaml.safe_load(written(tmp_path, "starts_centred", parameters=small).read_text())
    of = {"mass": "m", "yaw_inertia": "J", "front_axle_distance": "lf", "rear_axle_distance": "lr",
          "front_stiffness": "cf", "rear_stiffness": "cr", "rear_axle_inertia": "jw"}  # fmt: skip
    data["car"] |= {field: small[name] for field, name in of.items()} | {"torque_min": -1.0, "torque_max": 1.0}
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(data))
    large = lead_in_needed(
        read_simulator_car(written(tmp_path, "starts_centred", parameters=PARAMETERS | {"soft": 0.12}))
    )
    found = lead_in_needed(read_simulator_car(tmp_path / "small.yaml"))
    assert found.helps
    assert found.lead_in == pytest.approx(share * large.lead_in, rel=0.05)
    assert found.lead_in < 0.5 * large.lead_in


def test_a_lead_in_that_the_file_does_not_name_is_found_and_written(tmp_path: Path) -> None:
    slow = PARAMETERS | {"soft": 0.12}
    car, said = led_in(read_simulator_car(written(tmp_path, "starts_centred", parameters=slow)))
    assert said[0].endswith(f"lead_in: {car.simulator.lead_in:g}, which is used")
    assert 0.4 <= car.simulator.lead_in <= 0.8
    write_vehicle(tmp_path / "led.yaml", car)
    assert read_simulator_car(tmp_path / "led.yaml").simulator.lead_in == car.simulator.lead_in
    kept = read_simulator_car(written(tmp_path, "starts_centred", parameters=slow, lead_in=0.0, name="kept.yaml"))
    same, warned = led_in(kept)
    assert same is kept
    assert "with lead_in: " in warned[0]
    good = read_simulator_car(written(tmp_path, name="good.yaml"))
    assert led_in(good) == (good, [])


def test_where_roll_outs_fail_no_lead_in_is_named(tmp_path: Path) -> None:
    car = read_simulator_car(written(tmp_path, "not_finite"))
    assert led_in(car) == (car, [])
    assert roll_all([]) == []


def test_modules_of_one_name_in_two_folders_are_two(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "mine.py").write_text(f"def simulate(*_): return {name!r}\n")
    assert [function_of("mine:simulate", str(tmp_path / name))() for name in ("one", "two", "one")] == [
        "one", "two", "one",
    ]  # fmt: skip


def test_a_crash_and_a_hang_are_bounded_counted_and_named(tmp_path: Path) -> None:
    for function, said in (("ends", "process ended in a roll-out"), ("hangs", r"took longer than 1 s")):
        path = written(tmp_path, function, limit=1.0)
        found = checked(path)
        assert any("m of 1740" in one.sentence and re.search(said, one.sentence) for one in found.findings)
        assert cost_of(read_car(path)[0].simulator).failed > 0


CANNOT_BE_RUN = {
    "not_finite": r"a car that rolls straight on cannot be simulated: its outputs are no finite numbers",
    "forgets": r"output w is not among what it returned \(r, vx, vy, psi\)",
    "too_short": r"output \w+ has the shape \(1, 80\), expected \(1, 81\)",
    "no_dict": r"returned list, not a dict of its outputs by name",
    "nowhere": r"bicycle:nowhere: the module bicycle has no function nowhere",
}


@pytest.mark.parametrize("function", CANNOT_BE_RUN)
def test_what_cannot_be_run_is_one_sentence(tmp_path: Path, function: str) -> None:
    with pytest.raises(SimulatorError, match=CANNOT_BE_RUN[function]):
        checked(written(tmp_path, function))


def test_what_simulators_of_two_folders_import_is_each_ones_own(tmp_path: Path) -> None:
    """A package of one name in both, and a module in it that imports its neighbour."""
    for name in ("one", "two"):
        package = tmp_path / name / "vehicle"
        package.mkdir(parents=True)
        (package / "__init__.py").write_text("")
        (package / "numbers_of.py").write_text(f"NAME = '{name}'\n")
        (package / "model.py").write_text("from vehicle.numbers_of import NAME\n\ndef simulate():\n    return NAME\n")
    for name in ("one", "two", "one", "two"):
        function_of.cache_clear()
        assert function_of("vehicle.model:simulate", str(tmp_path / name))() == name


def test_a_folder_that_has_the_name_of_this_package_does_not_replace_it(tmp_path: Path) -> None:
    (tmp_path / "drift_drake").mkdir()
    (tmp_path / "mine.py").write_text("import drift_drake\n\ndef simulate():\n    return drift_drake\n")
    before = sys.modules["drift_drake"]
    assert function_of("mine:simulate", str(tmp_path))() is before


def test_a_module_that_cannot_be_imported(tmp_path: Path) -> None:
    (tmp_path / "needs_more.py").write_text("import no_such_package\n")
    (tmp_path / "ends_python.py").write_text("import sys\nsys.exit(0)\n")
    for module, said in (("needs_more", "ModuleNotFoundError.*install what it needs"), ("ends_python", "ends Python")):
        path = written(tmp_path, python=f"{module}:simulate")
        path.write_text(path.read_text().replace(str(Path(__file__).parent), str(tmp_path)))
        with pytest.raises(SimulatorError, match=said):
            checked(path)


def test_as_a_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulator", "check", str(written(tmp_path)), "--json", str(tmp_path / "found.json")]) == 0
    said = capsys.readouterr().out
    assert "nothing to be put right" in said
    assert "left out: sliding_friction_drop" in said
    assert json.loads((tmp_path / "found.json").read_text())["findings"]
    assert main(["simulator", "check", str(written(tmp_path, "other_sign"))]) == 1
    assert "! steering moves r" in capsys.readouterr().out
    assert main(["simulator", "check", str(written(tmp_path, "nowhere"))]) == 2
