"""The MPC's benchmark, on a few short problems; what it times is not judged."""

import json
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.common.errors import InvalidOptionError
from experiments.drifting import benchmark_mpc
from experiments.drifting.benchmark_mpc import PARTS, BenchmarkConfig, main, statistics
from experiments.drifting.timed_parts import TimedModel

CONFIG = BenchmarkConfig(horizons=(3, 5), problems=4, referee_problems=1, referee_horizon=3, warm_problems=3)


def test_a_benchmark_names_machine_parts_counts_and_referees(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(BenchmarkConfig(**{**vars(CONFIG), "out": tmp_path}))
    numbers = json.loads((tmp_path / "numbers.json").read_text())
    assert set(numbers["horizons"]) == {"3", "5"}
    for found in numbers["horizons"].values():
        assert set(found["ms"]) == set(PARTS)
        for values in found["ms"].values():
            assert 0.0 < values["median"] <= values["99.9 %"] <= values["worst"]
        assert found["iterations"] >= CONFIG.problems
        assert found["unsolved"] == found["failed"] == 0
        assert found["plan_over_floor"] > 1.0
    (answer,) = numbers["referees"]["3"]
    assert all(found["solved"] for found in answer.values())
    assert ("casadi_ipopt" in answer) == benchmark_mpc.installed() == (numbers["missing"] == "")
    np.testing.assert_allclose([found["cost"] for found in answer.values()], answer["sqp"]["cost"], atol=1e-4)
    assert set(numbers["relative_to_snopt"]) == {"linearise", "real_time_iteration", "snopt_warm"}
    assert numbers["machine"] in capsys.readouterr().out


def test_without_casadi_a_benchmark_says_so_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(benchmark_mpc, "installed", lambda: False)
    main(BenchmarkConfig(horizons=(3,), problems=2, referee_problems=1, warm_problems=2, out=tmp_path))
    assert "needs casadi; install the extra: pip install 'drift_drake[peers]'" in capsys.readouterr().out
    (answer,) = json.loads((tmp_path / "numbers.json").read_text())["referees"]["3"]
    assert set(answer) == {"sqp", "snopt", "ipopt"}


def test_the_slowest_plans_are_solved_again_with_others(tmp_path: Path) -> None:
    main(BenchmarkConfig(horizons=(3,), problems=4, again=2, referee_horizon=1, warm_problems=2, out=tmp_path))
    (ratio,) = json.loads((tmp_path / "numbers.json").read_text())["worst_over_median_again"].values()
    assert ratio >= 1.0
    assert f"solved again: the longest takes {ratio:.2f} times the median" in (tmp_path / "report.md").read_text()


def test_too_few_problems_are_refused_before_any_is_solved() -> None:
    with pytest.raises(InvalidOptionError, match="--warm-problems is 0; give 2 or more"):
        main(BenchmarkConfig(warm_problems=0))


def test_a_timed_model_is_the_model() -> None:
    model = NominalStepModel(VehicleParameters())
    timed = TimedModel(model)
    arguments = np.tile([0.1, 12.0, -0.2, 14.0, 0.1, 0.2], (2, 1)), np.ones((2, 2)), np.ones((2, 2)), np.zeros(2)
    np.testing.assert_array_equal(timed.step(*arguments), model.step(*arguments))
    for given, wanted in zip(timed.linearize(*arguments), model.linearize(*arguments), strict=True):
        np.testing.assert_array_equal(given, wanted)
    assert timed.linearise > 0.0
    assert timed.step_time > 0.0


def test_statistics_are_in_milliseconds() -> None:
    found = statistics([0.001] * 998 + [0.002, 0.010])
    assert (found["median"], found["worst"]) == pytest.approx((1.0, 10.0))
    assert 1.0 < found["99.9 %"] < 10.0
