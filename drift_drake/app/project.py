"""A project: a folder's recordings, days and steps, all kept in its files, and which steps' inputs have changed since.

`project.yaml` has what no other file says: the day of each recording, what is trimmed, which days a car is calibrated
on, and of each step that was run the command, a hash of its inputs and what it said.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import filelock
import yaml

from drift_drake.car.log.table import IMPORT_REPORT, run_paths
from drift_drake.common.errors import DriftDrakeError, shown
from drift_drake.common.plain_files import LARGEST_YAML, parse_yaml, read_json, read_text
from drift_drake.common.safe_files import write_text
from drift_drake.gap.logs.importing.formats.known_formats import ENDINGS

FILE = "project.yaml"
MAPPING = "mapping.yaml"
CAR = "car.yaml"
CALIBRATED, CALIBRATION, CALIBRATION_REPORT = "calibrated.yaml", "calibrated.json", "calibrated.html"
TEXTS = (
    ".txt",
    ".tsv",
    ".dat",
    ".log",
    ".asc",
    ".trc",
    ".csv.gz",
)  # of recordings, in addition to the formats' own endings
KEYS = {"recordings": dict, "days": dict, "options": dict, "steps": dict}


class InvalidProjectError(DriftDrakeError, ValueError):
    """A project file that cannot be used; the message says what to do."""


class Project:
    """The project of a folder. Every change is made to what the file holds at that moment, under a lock, so that two
    windows, or two workbenches, do not lose each other's."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._hashes: dict[Path, tuple[tuple[int, int], str]] = {}

    def read(self) -> dict[str, Any]:
        """What the project file holds.

        Raises:
            InvalidProjectError: it is no project file.
        """
        path = self.folder / FILE
        data: Any = {}
        if path.exists():
            text = read_text(path, InvalidProjectError, "take it away to begin anew", LARGEST_YAML)
            data = parse_yaml(text, InvalidProjectError, str(path), "take it away to begin anew") or {}
        for key, kind in KEYS.items():
            if not isinstance(data, dict) or not isinstance(data.setdefault(key, {}), kind):
                raise InvalidProjectError(f"{path}: '{key}' is {shown(data)}; take the file away to begin anew")
        return dict(data)

    @contextmanager
    def changing(self) -> Iterator[dict[str, Any]]:
        """What the project file holds, to be changed within the block; written at its end."""
        with filelock.FileLock(self.folder / ".project.lock"):
            data = self.read()
            yield data
            write_text(self.folder / FILE, yaml.safe_dump(data, sort_keys=False, allow_unicode=True))

    def set_option(self, key: str, value: Any) -> None:
        """Changes one of the options of all steps."""
        with self.changing() as data:
            data["options"][key] = value

    def mapping(self, name: str = MAPPING) -> dict[str, Any] | None:
        """What a mapping file holds, None where there is none yet; raises InvalidProjectError where it is no YAML."""
        path = self.folder / name
        if not path.exists():
            return None
        data = parse_yaml(read_text(path, InvalidProjectError, "write a mapping", LARGEST_YAML), InvalidProjectError,
                          name, "write 'name: value' lines")  # fmt: skip
        if not isinstance(data, dict):
            raise InvalidProjectError(f"{name}: must hold 'name: value' lines; take it away to begin anew")
        return data

    def change_mapping(self, change: Callable[[dict[str, Any]], None], name: str = MAPPING) -> None:
        """Changes what a mapping file holds at that moment."""
        with filelock.FileLock(self.folder / ".project.lock"):
            data = self.mapping(name) or {"clocks": {}, "signals": {}}
            change(data)
            write_text(self.folder / name, mapping_text(data))

    def mapping_of(self, day: str, data: dict[str, Any] | None = None) -> str:
        """The mapping file of a day's recordings: the one that days share, unless it has its own."""
        return f"mapping {day}.yaml" if self.day(day, data).get("own_mapping") else MAPPING

    def recordings(self) -> list[str]:
        """Files of the folder that look like recordings, by their paths within it."""
        found = []
        for place in (self.folder, self.folder / "recordings"):
            for path in sorted(place.iterdir()) if place.is_dir() else ():
                name = path.name.lower()
                if path.is_file() and name[0] not in ".-" and (path.suffix.lower() in ENDINGS or name.endswith(TEXTS)):
                    found.append(str(path.relative_to(self.folder)))
        return [name for name in found if not Path(name).name.startswith(("run_", "plan", "path_"))]

    def days(self, data: dict[str, Any] | None = None) -> dict[str, list[str]]:
        """Recordings by day, in order; of days that are folders of runs already, none."""
        data = data or self.read()
        here = set(self.recordings())
        days: dict[str, list[str]] = {}
        for name, day in data["recordings"].items():
            if day and name in here:
                days.setdefault(str(day), []).append(str(name))
        logs = self.folder / "logs"
        for path in sorted(logs.iterdir()) if logs.is_dir() else ():
            if path.is_dir() and path.name[0] != "." and run_paths(path):
                days.setdefault(path.name, [])
        return days

    def day(self, day: str, data: dict[str, Any] | None = None) -> dict[str, Any]:
        """What is said of a day: `start`, `end` [s], `baseline`, `accepted`, `own_mapping`, `validation`."""
        found = (data or self.read())["days"].get(day)
        return found if isinstance(found, dict) else {}

    def runs(self, day: str) -> list[Path]:
        """Files of a day's runs, by their paths within the folder."""
        folder = self.folder / "logs" / day
        return [path.relative_to(self.folder) for path in run_paths(folder)] if folder.is_dir() else []

    def names(self, day: str) -> dict[str, str]:
        """What a day's runs are called: the recording that each is of, by its file's name without the ending."""
        path = self.folder / "logs" / day / IMPORT_REPORT
        runs = read_json(path, InvalidProjectError, "import the day again").get("runs", []) if path.exists() else []
        return {
            f"run_{k}": f"{run['recording']}, {run['start']:.0f} to {run['end']:.0f} s" for k, run in enumerate(runs)
        }

    def digest(self, paths: Iterable[str | Path], more: object = "") -> str:
        """Of files' contents and of what else a step depends on; files that are not there count as such."""
        whole = hashlib.sha256(repr(more).encode())
        for path in paths:
            whole.update(f"{path}={self._hash(self.folder / path)}\n".encode())
        return whole.hexdigest()[:16]

    def _hash(self, path: Path) -> str:
        if not path.is_file():
            return ""
        now = path.stat()
        stamp = (now.st_mtime_ns, now.st_size)
        kept = self._hashes.get(path)
        if kept is None or kept[0] != stamp:
            with path.open("rb") as file:
                kept = self._hashes[path] = stamp, hashlib.file_digest(file, "sha256").hexdigest()
        return kept[1]


def mapping_text(data: dict[str, Any]) -> str:
    """A mapping file as `import --look` lays it out, without its comments."""
    return yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)
