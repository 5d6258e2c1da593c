"""An FMU as a simulator: one that pythonfmu builds of a Python class, against the class itself."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml

from drift_drake.car.car_file import read_car
from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.foreign.asked import job_of, motion_of
from drift_drake.car.foreign.check import check_simulator
from drift_drake.car.foreign.pool import end_workers, roll_all
from drift_drake.car.foreign.rollouts import SimulatorError
from drift_drake.car.foreign.simulator_car import SimulatorCar

EXAMPLES = Path(__file__).parents[3] / "examples" / "simulators"


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory):
    pytest.importorskip("pythonfmu", reason="pythonfmu builds the FMU")
    pytest.importorskip("fmpy")
    folder = tmp_path_factory.mktemp("fmu")
    build = [sys.executable, "-m", "pythonfmu", "build", "-f", str(EXAMPLES / "fmu_car.py"), "-d", str(folder)]
    subprocess.run(build, check=True, capture_output=True)
    yield folder / "FmuCar.fmu"
    end_workers()


def car_of(folder: Path, path: Path, **changes) -> SimulatorCar:
    data = yaml.safe_load((EXAMPLES / "fmu_car.yaml").read_text())
    for key, more in changes.items():
        data["simulator"][key] |= more
    data["simulator"]["fmu"] = str(path)
    described = folder / "fmu_car.yaml"
    described.write_text(yaml.safe_dump(data, sort_keys=False))
    car, _ = read_car(described)
    assert isinstance(car, SimulatorCar)
    return car


def test_it_moves_as_its_class_does(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    from fmu_car import FmuCar

    car = car_of(tmp_path, fmu)
    t, dt = 0.01 * np.arange(61), 0.01
    steer, torque = 0.05 * np.sin(3.0 * t), 60.0 + 0.0 * t
    start = np.array([[0.1, 13.0, 0.02, 13.2, 0.0]])
    heavy = car.simulator.changed_constants(car.constants(), make_effects({"mass_error": 0.2}))
    found = []
    for constants in (car.constants(), heavy, car.constants()):  # one instance, reset in between
        (got,) = roll_all([job_of(constants, dt, start, {"steering": steer[None], "torque": torque[None]})])
        found.append(motion_of(car.simulator, got, dt)[0])
    assert np.array_equal(found[0], found[2])
    alone = FmuCar(instance_name="alone")
    alone.vx0, alone.vy0, alone.r0, alone.w0 = 13.0 * np.cos(0.02), 13.0 * np.sin(0.02), 0.1, 13.2 / 0.32
    alone.exit_initialization_mode()
    own = [(alone.r, np.hypot(alone.vx, alone.vy), np.arctan2(alone.vy, alone.vx), 0.32 * alone.w, alone.psi)]
    for row in range(60):
        alone.steer, alone.torque = 0.5 * (steer[row] + steer[row + 1]), 8.0 * 0.5 * (torque[row] + torque[row + 1])
        alone.do_step(t[row], dt)
        own.append((alone.r, np.hypot(alone.vx, alone.vy), np.arctan2(alone.vy, alone.vx), 0.32 * alone.w, alone.psi))
    assert np.allclose(found[0], own, atol=1e-9)
    assert np.abs(found[1] - found[0])[:, 1].max() > 0.05


def test_nothing_is_wrong_with_it(fmu: Path, tmp_path: Path) -> None:
    assert [one.sentence for one in check_simulator(car_of(tmp_path, fmu)).findings if one.grade != "good"] == []


def test_what_is_wrong_with_an_fmu_is_one_sentence(fmu: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "other.fmu"
    shutil.copy(fmu, elsewhere)
    with zipfile.ZipFile(elsewhere) as archive, zipfile.ZipFile(tmp_path / "windows.fmu", "w") as without:
        for name in archive.namelist():
            without.writestr(name.replace("linux64", "win64").replace("darwin64", "win64"), archive.read(name))
    (tmp_path / "none.fmu").write_bytes(b"no archive")
    for path, changes, said in (
        (tmp_path / "missing.fmu", {}, r"missing\.fmu: there is no such FMU; correct fmu:"),
        (tmp_path / "none.fmu", {}, r"none\.fmu: is no FMU 2\.0 or 3\.0 that can be read"),
        (tmp_path / "windows.fmu", {}, r"windows\.fmu: is built for win64, not for .*; export it for this platform"),
        (
            fmu,
            {"parameters": {"mas": 1.0}},
            r"the FMU has no variable mas, which the file names as",
        ),
        (
            fmu,
            {"outputs": {"psi": "yaw"}},
            r"no variable yaw, which the file names as output",
        ),
    ):
        with pytest.raises(SimulatorError, match=said):
            check_simulator(car_of(tmp_path, path, **changes))
