"""Folders of runs (cases), and folders of such folders."""

from pathlib import Path

from drift_drake.car.log.table import InvalidLogError, run_paths


def case_name(folder: Path) -> str:
    """Name of a case: its folder's own, which is its folder's only even where folders are links; or its file's."""
    if folder.is_file():
        return Path(folder.name.removesuffix(".gz")).stem
    return folder.name if folder.name not in ("", "..") else folder.resolve().name


def case_folders(folder: str | Path) -> list[Path]:
    """The folder itself if it holds runs (or the file of one), else its subfolders that do.

    Raises:
        InvalidLogError: there is no run in either.
    """
    folder = Path(folder)
    if run_paths(folder):
        return [folder]
    if not folder.is_dir():
        raise InvalidLogError(f"{folder}: no such folder; give a case (run_0.csv, run_1.csv, ...) or a folder of cases")
    cases = sorted(path for path in folder.iterdir() if path.is_dir() and run_paths(path))
    if not cases:
        raise InvalidLogError(f"{folder}: holds no runs; a case is a folder of run_0.csv, run_1.csv, ...")
    return cases
