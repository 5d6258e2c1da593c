"""Each example runs, with short settings, and stays short."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from drift_drake import VehicleParameters
from drift_drake.gap.next_drive.plan import NextDriveConfig

EXAMPLES = Path(__file__).parents[1] / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.py"))


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"examples_{name}", EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", NAMES)
def test_each_is_short_and_says_what_it_does(name: str) -> None:
    text = (EXAMPLES / f"{name}.py").read_text()
    assert text.startswith('"""')
    assert text.count("\n") < 42


def test_the_figure_8_is_begun() -> None:
    assert example("drive_figure_8").main(time_factor=0.01) == "time is up"


def test_an_own_car_drives(tmp_path: Path) -> None:
    assert example("own_car").main(tmp_path, 1.0) > 12.0
    assert {path.name for path in tmp_path.iterdir()} == {"my_car.yaml", "my_car.csv"}


def test_an_own_effect_acts() -> None:
    assert example("own_effect").main() == (0.0, 800.0, 240.0)


def test_an_own_effect_has_a_state_or_is_a_delay() -> None:
    found = example("own_effect_with_state")
    assert found.main() == 0.0
    assert found.rise(*[0.0] * 5, 100.0, None, 0.25, 0.0) == 400.0
    assert (found.TURBO_LAG.stage, found.ENGINE_BUS.delays) == ("actuator", "tau_cmd")


def test_one_system_runs_alone() -> None:
    found, car = example("one_system"), VehicleParameters()
    assert found.refused_plans(car) == 1.0
    assert found.turned(car) > 0.05
    samples, moved = example("one_adapter").main()
    assert samples == 1.0
    assert moved > 0.0


def test_an_own_controller_drives() -> None:
    assert example("own_controller").main(time_factor=0.01) == "time is up"


def test_an_own_controller_has_states() -> None:
    assert example("own_controller_with_state").main() == "completed"


def test_an_own_diagram_holds_course_and_speed() -> None:
    r, v, *_ = example("own_diagram").main()
    assert abs(r) < 0.05
    assert abs(v - 15.0) < 1.0


def test_an_own_kind_of_car_turns_less_the_more_it_scrubs() -> None:
    little, much = example("cars/kart").main()
    assert much - little == pytest.approx(-45.0 / 22.0)  # [N m s] of one [rad/s] over the yaw inertia


def test_an_own_tyre_has_a_curve_of_its_own() -> None:
    smooth, brush = example("own_tyre").main()
    assert (smooth[1:] != brush[1:]).all()
    assert (np.diff(smooth) > 0.0).all()


def test_an_own_model_plans() -> None:
    u = example("own_model").main(horizon=5)
    assert u.shape == (6, 2)
    assert np.isfinite(u).all()


def test_a_log_adapts_the_model() -> None:
    before, after = example("adapt_to_log").main()
    assert after[0] < before[0]


def test_logs_are_diagnosed(tmp_path: Path) -> None:
    effects = ("front_stiffness_error", "aero_drag")
    answer, corrected = str(tmp_path / "answer.json"), str(tmp_path / "corrected.yaml")
    found = example("diagnose_log").main(200, effects, answer, corrected)
    assert found.causes == ["front_stiffness_error"]
    assert {path.name for path in tmp_path.iterdir()} == {"answer.json", "corrected.yaml"}


@pytest.mark.slow
def test_a_next_drive_is_planned(tmp_path: Path) -> None:
    drive = example("plan_next_drive").main(config=NextDriveConfig(steps=15), out=str(tmp_path / "plan.csv"))
    assert drive.after >= drive.before
    assert (tmp_path / "plan.csv").is_file()


def test_a_car_and_a_log_are_exported(tmp_path: Path) -> None:
    assert len(example("export").main(tmp_path)) > 5
    assert {path.name for path in tmp_path.iterdir()} == {"car.xml", "car.yaml"}
