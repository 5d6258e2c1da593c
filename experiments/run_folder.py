"""The folder in which an experiment leaves what it was asked, what it found and what it ran on."""

import dataclasses
import datetime
import json
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

PACKAGES = ("drift_drake", "drake", "numpy", "scipy", "numba", "osqp")


def make_run_folder(parent: Path, name: str, config: Any) -> Path:
    """A new folder `parent/name-<UTC time>` with config.json: the configuration (seeds included) and the versions.

    Args:
        config: a dataclass instance of plain values and paths.
    """
    stamp = datetime.datetime.now(datetime.UTC).strftime("%Y%m%d-%H%M%S")
    folder = parent / f"{name}-{stamp}"
    folder.mkdir(parents=True)
    versions = {package: version(package) for package in PACKAGES} | {"python": platform.python_version()}
    about = {"config": dataclasses.asdict(config), "versions": versions}
    (folder / "config.json").write_text(json.dumps(about, indent=1, default=str))
    return folder
