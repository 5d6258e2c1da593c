"""FMUs of C: 2.0 for model exchange, 3.0 for co-simulation and for model exchange, against the same equations."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from compiled_fmu import COMPILER, KINDS, build
from scipy.integrate import solve_ivp

from drift_drake.car.car_file import read_car
from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.foreign.asked import job_of, motion_of
from drift_drake.car.foreign.check import check_simulator
from drift_drake.car.foreign.pool import end_workers, roll_all
from drift_drake.car.foreign.rollouts import SimulatorError
from drift_drake.car.foreign.simulator_car import SimulatorCar

EXAMPLES = Path(__file__).parents[3] / "examples" / "simulators"
EACH = [
    *((version, kind) for version, kinds in KINDS.items() for kind in kinds),
    ("2.0", "ModelExchange", "-DNO_RESET"),
]
pytestmark = pytest.mark.skipif(COMPILER is None, reason="a C compiler builds the FMUs: apt install gcc")


@pytest.fixture(scope="module", params=EACH, ids=lambda each: "-".join(each))
def car(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    pytest.importorskip("fmpy")
    folder = tmp_path_factory.mktemp("fmu")
    data = yaml.safe_load((EXAMPLES / "fmu_car.yaml").read_text())
    data["simulator"]["fmu"] = str(build(folder, *request.param))
    described = folder / "car.yaml"
    described.write_text(yaml.safe_dump(data, sort_keys=False))
    found, _ = read_car(described)
    assert isinstance(found, SimulatorCar)
    yield found, request.param[1]
    end_workers()


def by_its_equations(delta: np.ndarray, torque: np.ndarray, dt: float, held: bool, **parameters: float) -> np.ndarray:
    """(r, v, beta, omega_r, psi) [rows] of the Python class's equations; held: each row's mean command, or linear."""
    pytest.importorskip("pythonfmu")
    from fmu_car import FmuCar

    car, t = FmuCar(instance_name="alone"), dt * np.arange(len(delta))
    for name, value in parameters.items():
        setattr(car, name, value)

    def rates(at: float, z: np.ndarray, row: int) -> tuple[float, ...]:
        share = 0.5 if held else (at - t[row]) / dt
        car.steer = (1.0 - share) * delta[row] + share * delta[row + 1]
        car.torque = 8.0 * ((1.0 - share) * torque[row] + share * torque[row + 1])
        return (*car._rates(*z[:4]), z[2])

    z = [np.array([13.0 * np.cos(0.02), 13.0 * np.sin(0.02), 0.1, 13.2 / 0.32, 0.0])]
    for row in range(len(t) - 1):
        found = solve_ivp(rates, (t[row], t[row + 1]), z[-1], args=(row,), rtol=1e-10, atol=1e-10)
        z.append(found.y[:, -1])
    v_x, v_y, r, w, psi = np.array(z).T
    return np.stack([r, np.hypot(v_x, v_y), np.arctan2(v_y, v_x), 0.32 * w, psi], axis=1)


def test_it_moves_as_its_equations_do(car: tuple[SimulatorCar, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    simulated, kind = car
    t, dt = 0.01 * np.arange(61), 0.01
    delta, torque = 0.05 * np.sin(3.0 * t), 60.0 + 40.0 * np.cos(5.0 * t)
    start = np.array([[0.1, 13.0, 0.02, 13.2, 0.0]])
    heavy = simulated.simulator.changed_constants(simulated.constants(), make_effects({"mass_error": 0.2}))
    found = []
    for constants in (simulated.constants(), heavy, simulated.constants()):  # one instance, reset in between
        (got,) = roll_all([job_of(constants, dt, start, {"steering": delta[None], "torque": torque[None]})])
        found.append(motion_of(simulated.simulator, got, dt)[0])
    assert np.array_equal(found[0], found[2])
    held = kind == "CoSimulation"
    for seen, parameters in zip(found, ({}, {"m": 1740.0}), strict=False):
        true = by_its_equations(delta, torque, dt, held, **parameters)
        assert np.abs(seen - true).max() < 1e-4  # what mass does is ten to a thousand times that


def test_a_library_that_cannot_be_loaded_is_one_sentence(car: tuple[SimulatorCar, str], tmp_path: Path) -> None:
    sound, broken = Path(car[0].simulator.target), tmp_path / "broken.fmu"
    with zipfile.ZipFile(sound) as archive, zipfile.ZipFile(broken, "w") as other:
        for name in archive.namelist():
            other.writestr(name, b"no library" if name.startswith("binaries") else archive.read(name))
    data = yaml.safe_load((EXAMPLES / "fmu_car.yaml").read_text())
    data["simulator"]["fmu"] = str(broken)
    (tmp_path / "car.yaml").write_text(yaml.safe_dump(data))
    with pytest.raises(SimulatorError, match=r"broken\.fmu: cannot be loaded \(.*\); try it with fmpy simulate"):
        check_simulator(tmp_path / "car.yaml")


def test_nothing_is_wrong_with_it(car: tuple[SimulatorCar, str]) -> None:
    assert [one.sentence for one in check_simulator(car[0]).findings if one.grade != "good"] == []
