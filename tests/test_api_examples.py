"""Every public name has an example in its docstring, and the cheap ones run and give what they say."""

import ast
import doctest
import itertools
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pydrake.solvers import Solve
from pydrake.systems.primitives import ConstantVectorSource

import drift_drake
from drift_drake.car.scalar import tanh

PACKAGE = Path(drift_drake.__file__).parent
PLACES = {
    name: PACKAGE.joinpath(*module.split("."))
    for module, name in re.findall(r"from \.([\w.]+) import (\w+) as", (PACKAGE / "__init__.pyi").read_text())
}
ANSWER = {
    "case": "monday", "verdict": "effect", "causes": ["steering_lag"], "seconds": 1.0,
    "posterior": {"steering_lag": 1.0}, "ambiguity": ["steering_lag"],
    "magnitudes": {"steering_lag": {"estimate": 0.1, "low": 0.09, "high": 0.11}}, "where": {},
    "reduction": {"estimate": 0.9, "low": 0.8, "high": 1.0},
}  # fmt: skip


def docstring(name: str) -> str:
    """Of a class, of a function, or of an assignment: the text below it."""
    place = PLACES[name]
    tree = ast.parse((place / "__init__.py" if place.is_dir() else place.with_suffix(".py")).read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == name:
            return ast.get_docstring(node) or ""
    (below,) = [after.value for node, after in itertools.pairwise(tree.body)
                if name in ast.unparse(node).split(" ")[0].split(":") and isinstance(after, ast.Expr)]  # fmt: skip
    return str(ast.literal_eval(below))


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What docs/api.md says that examples use in addition to the library's names, and the folder that they run in."""
    folder = tmp_path_factory.mktemp("api")
    public = {name: getattr(drift_drake, name) for name in drift_drake.__all__}
    car, x = drift_drake.VehicleParameters(), np.array([[0.0, 15.0, 0.0, 15.0, 0.0, 0.0]])
    drift_drake.write_vehicle(folder / "car.yaml", car)
    (folder / "answer.json").write_text(json.dumps(ANSWER))
    steering = 0.05 * np.sin(np.arange(0.0, 4.1, 0.1))
    driver = ConstantVectorSource(
        drift_drake.Plan(0.0, np.column_stack([steering, np.full(len(steering), 60.0)])).vector()
    )
    table, _ = drift_drake.Drive(car, driver, len(steering) - 1, 0.1, None, (0.0, 60.0)).run(x[0], 0.0, 4.0, seed=0)
    (folder / "logs" / "monday").mkdir(parents=True)
    table.to_csv(folder / "logs" / "monday" / "run_0.csv", index=False)
    reference = drift_drake.straight_line(7.5, 20.0, 4.5)
    return public | {
        "folder": folder, "np": np, "pd": pd, "Solve": Solve, "ConstantVectorSource": ConstantVectorSource,
        "SimpleNamespace": SimpleNamespace, "tanh": tanh, "car": car, "table": table, "x": x,
        "u": np.array([[0.0, 60.0]]), "model": drift_drake.load_model(), "reference": reference,
    }  # fmt: skip


@pytest.mark.parametrize("name", drift_drake.__all__)
def test_its_example_runs(name: str, names: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(names["folder"])
    text = docstring(name)
    assert "Examples:\n" in text
    example = doctest.DocTestParser().get_doctest(text, dict(names), name, name, 0)
    assert example.examples
    reported: list[str] = []
    failed = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(example, out=reported.append).failed
    assert not failed, "".join(reported)
