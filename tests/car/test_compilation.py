"""Compiled functions: processes that need one at the same time compile it once; which caches are stale."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from drift_drake.car import compilation
from drift_drake.car.compilation import PACKAGE, rests_on

SOURCE = """
import sys
from drift_drake.car.compilation import compiled

@compiled
def inner(x):
    total = 0.0
    for i in range(10):
        total += x**i
    return total

@compiled
def outer(x):
    return inner(x) + inner(2.0 * x)

print("ready", flush=True)
sys.stdin.readline()
outer(0.5)
print(sum(outer.stats.cache_misses.values()), sum(inner.stats.cache_misses.values()), outer(0.5))
"""


def compiled_functions():
    """(file, tree) of each function that is compiled."""
    for file in PACKAGE.rglob("*.py"):
        for function in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            marks = [getattr(mark, "id", "") for mark in getattr(function, "decorator_list", [])]
            if {"compiled", "jitable", "inlined"} & set(marks):
                yield file, function


def is_slice(target):
    return isinstance(target, ast.Subscript) and any(isinstance(part, ast.Slice) for part in ast.walk(target.slice))


def test_no_compiled_function_assigns_an_array_to_a_slice():
    """It brings numba's message for two sizes with it, which takes seconds to compile: `copied` takes its place."""
    found, seen = [], 0
    for file, function in compiled_functions():
        seen += 1
        for node in ast.walk(function):
            pairs = [(target, node.value) for target in node.targets] if isinstance(node, ast.Assign) else []
            for target, value in pairs:
                both = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
                for one, of in zip(target.elts, value.elts, strict=True) if both else [(target, value)]:
                    if is_slice(one) and not isinstance(of, ast.Constant):
                        found.append(f"{file.name}, {function.name}: {ast.unparse(node)}")
    assert seen > 100
    assert not found


def test_two_processes_compile_a_function_once(tmp_path):
    (tmp_path / "shared.py").write_text(SOURCE)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}
    both = [
        subprocess.Popen([sys.executable, "shared.py"], cwd=tmp_path, env=environment, text=True,
                         stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for _ in range(2)
    ]  # fmt: skip
    for process in both:
        assert process.stdout.readline() == "ready\n"
    for process in both:
        process.stdin.write("\n")
        process.stdin.flush()
    said = [process.communicate() for process in both]
    assert [errors for _, errors in said] == ["", ""]
    outer, inner, results = zip(*(line.split() for line, _ in said), strict=True)
    assert sorted(outer) == ["0", "1"]
    assert sum(map(int, inner)) <= 1  # the process that finds `outer` on the disk needs no `inner`
    assert results[0] == results[1]


LOADED = """
import importlib, json, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
print(json.dumps([m.__file__ for n, m in sys.modules.items() if n.startswith("drift_drake.") and m.__file__]))
"""


def test_compiled_modules_rest_on_all_that_they_load():
    compiled = [path for path in PACKAGE.rglob("*.py") if "\n@compiled\n" in path.read_text(encoding="utf-8")]
    names = [".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts) for path in compiled]
    done = subprocess.run([sys.executable, "-c", LOADED, *names], capture_output=True, text=True, check=True,
                          env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)})  # fmt: skip
    loaded = {Path(file) for file in json.loads(done.stdout)}
    loaded -= {path for path in loaded if path.name == "__init__.py" and "import" not in path.read_text("utf-8")}
    found = set().union(*(rests_on(path) for path in compiled))
    assert set(compiled) <= loaded
    assert not loaded - found


@pytest.mark.parametrize(("newer", "stays"), [("far.py", False), ("part/near.py", False), ("other.py", True)])
def test_a_cache_is_stale_once_a_file_that_it_rests_on_is_newer(tmp_path, monkeypatch, newer, stays):
    package = tmp_path / "drift_drake"
    (package / "part" / "__pycache__").mkdir(parents=True)
    index = package / "part" / "__pycache__" / "mine.function-1.py311.nbi"
    sources = {
        "part/mine.py": "from drift_drake.part import (\n    near,\n)\n",
        "part/near.py": "from drift_drake.far import NUMBER\n",
        "far.py": "NUMBER = 1.0\n",
        "other.py": "import drift_drake.part.mine\n",
    }
    for name, text in sources.items():
        (package / name).write_text(text)
        os.utime(package / name, (1000.0, 1000.0))
    index.write_text("")
    os.utime(index, (2000.0, 2000.0))
    os.utime(package / newer, (3000.0, 3000.0))
    monkeypatch.setattr(compilation, "PACKAGE", package)
    compilation._drop_stale_caches.__wrapped__()
    assert index.exists() == stays


@pytest.mark.parametrize("newer", [True, False])
def test_a_cache_outside_the_package_is_stale_once_the_package_is_newer(tmp_path, newer):
    source, index = tmp_path / "own.py", tmp_path / "__pycache__" / "own.step-3.py311.nbi"
    index.parent.mkdir()
    index.touch()
    last = max(file.stat().st_mtime for file in PACKAGE.rglob("*.py"))
    os.utime(index, (last - 1.0, last - 1.0) if newer else (last + 1.0, last + 1.0))
    compilation._drop_stale_caches_of(source)
    assert index.is_file() != newer
