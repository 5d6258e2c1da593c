"""What a command writes over, kept next to it under a hidden name until the command has ended well."""

import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

from drift_drake.car.log.table import IMPORT_REPORT
from drift_drake.common.safe_files import replacing


def there(folder: Path, names: Iterable[str]) -> dict[str, bool]:
    """Which of the files and folders exist, by their paths within the folder."""
    return {name: (folder / name).exists() for name in names}


def put_aside(folder: Path, written: Iterable[str]) -> None:
    """Copies files, and takes folders away, which a command makes anew."""
    for path in (folder / name for name in written):
        if path.is_file():
            with replacing(_aside(path)) as part:
                shutil.copy2(path, part)
        else:
            _remove(_aside(path))
            if path.is_dir():
                path.rename(_aside(path))


def put_back(folder: Path, written: Mapping[str, bool]) -> None:
    """All as it was before, wherever the command was ended; written: with what was `there`."""
    for name, existed in written.items():
        path, kept = folder / name, _aside(folder / name)
        if kept.exists():
            if path.is_dir() or kept.is_dir():
                _remove(path)
            kept.replace(path)  # a file in one step: a page that asks for it meanwhile gets it
        elif not existed:
            _remove(path)


def drop(folder: Path, written: Iterable[str]) -> None:
    """Drops what was put aside, but for files in a folder that no command wrote."""
    for path in (folder / name for name in written):
        if _aside(path).is_dir():
            for one in _aside(path).iterdir():
                if not one.name.startswith(("run_", IMPORT_REPORT)):
                    one.rename(path / one.name)
        _remove(_aside(path))


def _aside(path: Path) -> Path:
    return path.with_name(f".{path.name}.before")


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
