"""The wheel alone, in a fresh environment outside the checkout: what it holds, and its commands."""

import ast
import gzip
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from drift_drake.cli.demo import commands

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "drift_drake"
OUTSIDE = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}  # which may name the checkout


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    shutil.copytree(PACKAGE, source / PACKAGE.name, ignore=shutil.ignore_patterns("__pycache__"))
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    built = subprocess.run([*build, "--wheel-dir", str(out), str(source)], capture_output=True, text=True)
    if "No module named 'setuptools'" in built.stderr or "Cannot import 'setuptools" in built.stderr:
        pytest.skip("setuptools is not installed, which builds the wheel")
    assert built.returncode == 0, built.stderr
    (made,) = out.glob("*.whl")
    return made


@pytest.fixture(scope="session")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bin folder of an environment with the wheel, which sees this one's other packages."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, with_pip=False)
    python = home / "bin" / "python"
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*install, str(wheel)], check=True, env=OUTSIDE)
    (packages,) = home.glob("lib/python*/site-packages")
    (packages / "others.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return home / "bin"


def run(installed: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(installed / "drift-drake"), *words], cwd=folder, env=OUTSIDE, capture_output=True,
                          text=True)  # fmt: skip


def test_the_package_needs_nothing_of_the_checkout() -> None:
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and node.module else []
            outside = {"experiments", "diagrams", "examples", "tests"} & {name.split(".")[0] for name in names}
            assert not outside, f"{path} imports {outside}"


def test_the_wheel_holds_every_file_of_the_package(wheel: Path) -> None:
    files = {str(path.relative_to(ROOT)) for path in PACKAGE.rglob("*") if path.is_file()}
    wanted = {name for name in files if "__pycache__" not in name}
    with zipfile.ZipFile(wheel) as archive:
        assert wanted <= set(archive.namelist())


def test_light_commands_work_from_the_wheel(installed: Path, tmp_path: Path) -> None:
    version = run(installed, tmp_path, "--version")
    assert (version.returncode, version.stdout[:12]) == (0, "drift-drake "), version.stderr
    assert run(installed, tmp_path, "init", "car.yaml").returncode == 0
    listed = run(installed, tmp_path, "effects", "--vehicle", "car.yaml")
    assert "steering_lag" in listed.stdout, listed.stderr
    missing = run(installed, tmp_path, "diagnose", "nowhere", "--vehicle", "car.yaml")
    assert (missing.returncode, missing.stderr.count("\n")) == (2, 1)


def test_the_demos_commands_can_be_read(tmp_path: Path) -> None:
    import tyro

    from drift_drake.cli.main import load

    for name, *words in commands(tmp_path):
        assert tyro.cli(load(name)[0], args=words)


@pytest.mark.slow
def test_the_demo_runs_from_the_wheel(installed: Path, tmp_path: Path) -> None:
    """A diagnosis, the corrected car, its replay and a drift."""
    done = run(installed, tmp_path, "demo", "demo")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "sample: front_stiffness_error" in done.stdout
    assert "completed after" in done.stdout
    assert all((tmp_path / "demo" / name).stat().st_size > 10_000 for name in ("report.html", "drive/replay.html"))


def readme_commands() -> list[list[str]]:
    """Words of the command lines in the README's code blocks."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    lines = "\n".join(re.findall(r"```\n(.*?)```", text, re.DOTALL)).splitlines()
    return [shlex.split(line)[1:] for line in lines if line.startswith("drift-drake ")]


@pytest.mark.slow
def test_the_readmes_commands_run_from_the_wheel(installed: Path, tmp_path: Path) -> None:
    """On the sample log and the starter vehicle, in the README's order: each leaves what the next one reads."""
    assert run(installed, tmp_path, "init", "car.yaml").returncode == 0
    (tmp_path / "logs" / "monday").mkdir(parents=True)
    for name in ("run_0", "run_1"):
        with gzip.open(PACKAGE / "data" / "sample_log" / f"{name}.csv.gz", "rb") as packed:
            (tmp_path / "logs" / "monday" / f"{name}.csv").write_bytes(packed.read())
    names = [words[0] for words in readme_commands()]
    assert {"check", "diagnose", "apply", "replay"} <= set(names)
    for words in readme_commands():
        done = run(installed, tmp_path, *words)
        assert done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
    assert (tmp_path / "corrected.yaml").read_text() != (tmp_path / "car.yaml").read_text()
    assert all((tmp_path / name).stat().st_size > 10_000 for name in ("answer.html", "replay.html"))


@pytest.mark.slow
def test_the_readmes_snippet_runs_from_the_wheel(installed: Path, tmp_path: Path) -> None:
    (snippet,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    done = subprocess.run([str(installed / "python"), "-c", snippet], cwd=tmp_path, env=OUTSIDE,
                          capture_output=True, text=True)  # fmt: skip
    assert done.stdout.startswith("completed "), done.stdout + done.stderr
