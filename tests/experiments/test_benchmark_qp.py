"""The benchmark of QP solvers: the same program in the stages' order, and every solver's solution of it."""

import json
from pathlib import Path

import numpy as np
import pytest

from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.qp.qp import QpOptions, QpWorkspace, constraint_matrix, row_limits
from experiments.drifting.benchmark_qp import QpBenchmarkConfig, decision, main, recorded, staged


def test_a_staged_program_is_the_recorded_one() -> None:
    (found, *_) = recorded(4, 2, seed=3)
    program = staged(found)
    solved = QpWorkspace(found.stages, QpOptions()).solve(*found)
    count, n = len(found.stages.columns), found.stages.state_size
    x, u, slack = found.stages.split(solved.z)
    table = np.zeros((count + 1, n + 6))
    table[:, :n], table[:, n : n + 2], table[1:, n + 2] = x, u, slack
    table[:-1, n + 3 : n + 5], table[:-1, n + 5] = u[1:], slack
    w = table.ravel()[:-3]
    np.testing.assert_array_equal(decision(found.stages, w), solved.z)
    # The same cost, and the same rows with the same limits, in another order.
    matrix, (low, high) = constraint_matrix(found.stages, found.f), row_limits(found.stages, found.target)
    values, theirs = matrix @ solved.z, program.matrix @ w
    np.testing.assert_allclose(np.sum((values >= low - 1e-6) & (values <= high + 1e-6)), values.size)
    assert np.all(theirs >= program.low - 1e-6)
    assert np.all(theirs <= program.high + 1e-6)
    ours = sum(0.5 * z @ h @ z for z, h in zip(solved.z[found.stages.columns], found.stages.hessian, strict=True))
    ours += found.stages.gradient @ solved.z
    assert 0.5 * w @ program.hessian @ w + program.gradient @ w == pytest.approx(ours)
    assert sum(program.sizes["ng"]) + count * (n + 3) == len(program.matrix)


def test_all_find_the_same_solution(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("casadi", reason="an extra: pip install drift_drake[peers]")
    main(QpBenchmarkConfig(horizons=(4,), problems=3, peers=("hpipm", "piqp"), out=tmp_path))
    (found,) = json.loads((tmp_path / "numbers.json").read_text())["horizons"].values()
    for name in ("ours", "hpipm", "piqp"):
        assert found[name]["solved"] == 1.0, name
        assert 0.0 < found[name]["ms"]["median"] <= found[name]["ms"]["worst"]
    assert "| 4 | hpipm |" in capsys.readouterr().out


def test_bad_options_are_one_sentence() -> None:
    with pytest.raises(InvalidOptionError, match="--problems is 1; give 2 or more"):
        main(QpBenchmarkConfig(problems=1))
    with pytest.raises(InvalidOptionError, match="--peers ipopt: there are hpipm, piqp, proxqp"):
        main(QpBenchmarkConfig(peers=("ipopt",)))
