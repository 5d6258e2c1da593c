"""The library's names: all there, and none imported before it is used."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import drift_drake
from drift_drake.common.errors import DriftDrakeError

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("name", drift_drake.__all__)
def test_every_name_is_there_and_documented(name: str) -> None:
    thing = getattr(drift_drake, name)
    assert name == "CATALOGUE" or thing.__doc__


def test_the_api_page_has_every_name() -> None:
    stub, page = (ROOT / "drift_drake" / "__init__.pyi").read_text(), (ROOT / "docs" / "api.md").read_text()
    wanted = {
        f"::: drift_drake.{module}.{name}" for module, name in re.findall(r"from \.([\w.]+) import (\w+) as", stub)
    }
    assert {line for line in page.splitlines() if line.startswith(":::")} == wanted


def test_the_import_itself_costs_nothing() -> None:
    program = "import sys, drift_drake; dir(drift_drake); print(*(m for m in ('numpy', 'pydrake') if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == ""


def test_one_error_is_above_all_that_the_package_raises() -> None:

    modules = [module for name, module in sys.modules.items() if name.startswith("drift_drake")]
    errors = {
        thing for module in modules for thing in vars(module).values()
        if isinstance(thing, type) and issubclass(thing, Exception) and thing.__module__.startswith("drift_drake")
    }  # fmt: skip
    assert len(errors) > 10
    assert all(issubclass(error, DriftDrakeError) for error in errors)
