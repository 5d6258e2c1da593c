"""One run as a table of columns (SI, ISO 8855): read, checked, written."""

import dataclasses
import itertools
import lzma
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drift_drake.car.log.plausible import ABSURD, implausible
from drift_drake.common.apart import read_guarded
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.plain_files import check_file, number, parse_json, read_text
from drift_drake.common.safe_files import write_columns

if TYPE_CHECKING:
    import pandas as pd

IMPORT_REPORT = "import.json"  # what an import wrote next to its runs
REQUIRED = ("t", "r", "v", "delta_cmd")
OPTIONAL = ("x", "y", "psi", "beta", "omega_r", "ax", "ay", "tau_cmd")
ROAD = ("bank",)  # of the road, known like a command; without it the road is taken to be flat
UNITS = {"t": "s", "x": "m", "y": "m", "psi": "rad", "r": "rad/s", "v": "m/s", "beta": "rad", "omega_r": "m/s",
         "ax": "m/s^2", "ay": "m/s^2", "delta_cmd": "rad", "tau_cmd": "N m", "bank": "rad"}  # fmt: skip
COLUMNS = tuple(UNITS)

SHORTEST_RUN = 50  # rows; less holds nothing to learn from
LONGEST_PERIOD = 0.05  # [s]
PERIOD_TOLERANCE = 0.02  # of the period that a row may be early or late
# What pandas raises on a broken file: another encoding, a truncated or damaged archive, no table.
UNREADABLE = (OSError, ValueError, EOFError, zlib.error, lzma.LZMAError, zipfile.BadZipFile)


class InvalidLogError(DriftDrakeError, ValueError):
    """A log that cannot be used; the message names the file, the place and the remedy."""


@dataclasses.dataclass(frozen=True)
class Run:
    """One run: a row each period. Columns that the log lacks are None.

    `t` [s]; `x`, `y` [m] and `psi` [rad] of the centre of gravity in a fixed frame; `r` [rad/s]; `v` [m/s]; `beta`
    [rad] course minus heading; `omega_r` [m/s] rear rim speed; `ax`, `ay` [m/s^2] in the body frame; `delta_cmd`
    [rad] and `tau_cmd` [N m] the commands, known exactly and linear between rows; `bank` [rad] of the road under the
    car, its left side higher, known too.
    `filled`: rows [bool] in which the screening has filled a bad sample, so that a column is no measurement there.
    `trusted`: columns that are asked no questions, since somebody has looked at them. `recording`: the name of the run
    that this is a part of; empty for a whole one.

    Raises:
        InvalidLogError: too few rows, a column of another length, NaN, an irregular clock, numbers of wrong units.

    Examples:
        >>> run = Run("still", t=0.01 * np.arange(100), r=np.zeros(100), v=np.ones(100), delta_cmd=np.zeros(100))
        >>> run.period
        0.01
    """

    name: str
    t: np.ndarray
    r: np.ndarray
    v: np.ndarray
    delta_cmd: np.ndarray
    tau_cmd: np.ndarray | None = None
    beta: np.ndarray | None = None
    omega_r: np.ndarray | None = None
    ax: np.ndarray | None = None
    ay: np.ndarray | None = None
    x: np.ndarray | None = None
    y: np.ndarray | None = None
    psi: np.ndarray | None = None
    bank: np.ndarray | None = None
    filled: np.ndarray | None = None
    trusted: tuple[str, ...] = ()
    recording: str = ""

    def __post_init__(self) -> None:
        _check(self)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def period(self) -> float:
        """Time between rows [s]."""
        return float((self.t[-1] - self.t[0]) / (len(self.t) - 1))

    def column(self, name: str) -> np.ndarray | None:
        """The column of that name, None where the log lacks it."""
        return getattr(self, name)

    def without(self, *names: str) -> "Run":
        """The same run with some optional columns taken out."""
        changes: dict[str, Any] = dict.fromkeys(names)
        return dataclasses.replace(self, **changes)

    def rows(self, start: int, stop: int) -> "Run":
        """Rows start:stop of the run."""
        return self._cut(slice(start, stop))

    def thinned(self, every: int) -> "Run":
        """One row in `every`."""
        return self if every == 1 else self._cut(slice(None, None, every))

    def _cut(self, part: slice) -> "Run":
        columns = {name: self.column(name) for name in (*COLUMNS, "filled")}
        cut: dict[str, Any] = {name: None if a is None else a[part] for name, a in columns.items()}
        return dataclasses.replace(self, **cut)


def read_run(path: str | Path) -> Run:
    """Reads the run of a path: a CSV (compressed or not) or Parquet file.

    Raises:
        InvalidLogError: unreadable or empty file, missing column, NaN, a clock that is not regular, wrong units.

    Examples:
        >>> len(read_run("logs/monday/run_0.csv"))
        401
    """
    path = Path(path)
    columns = read_columns(path)
    missing = [name for name in REQUIRED if name not in columns]
    if missing:
        raise InvalidLogError(
            f"{path}: missing column {', '.join(missing)}; a run needs {', '.join(REQUIRED)} "
            f"and may have {', '.join((*OPTIONAL, *ROAD))}"
        )
    return make_run(path, columns)


def make_run(path: Path, columns: dict[str, np.ndarray]) -> Run:
    """A run from the columns of a file, which its InvalidLogError names."""
    name = _recorded_name(path)
    try:
        return Run(name=name, trusted=trusted_columns(path.parent), recording="", **columns)
    except InvalidLogError as error:
        raise InvalidLogError(f"{path}: {str(error).removeprefix(name + ': ')}") from None


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """The log format's columns that a CSV or Parquet file has; InvalidLogError where one cannot be read."""
    check_file(path, InvalidLogError, "give the path of a run (CSV or Parquet)")
    return read_guarded(_read_columns, path, InvalidLogError)


def _read_columns(path: Path) -> dict[str, np.ndarray]:
    import pandas as pd  # slow to import

    try:
        table = pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)
    except pd.errors.EmptyDataError:
        raise InvalidLogError(f"{path}: the file is empty; a run needs a header and {SHORTEST_RUN} rows") from None
    except ImportError as error:
        raise InvalidLogError(f"{path}: needs a package to be read ({error}); install it, or write a CSV") from None
    except UNREADABLE as error:
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise InvalidLogError(f"{path}: cannot be read as a table ({reason}); write a CSV with a header") from None
    check_names(path, [str(name) for name in table.columns])
    table.columns = [str(name).strip() for name in table.columns]
    return {name: _numbers(path, name, table[name]) for name in COLUMNS if name in table.columns}


def check_names(path: Path, names: Sequence[str]) -> None:
    """Raises an InvalidLogError that names a column which is there twice; pandas calls a second `v` `v.1`."""
    bare = [name.strip() for name in names]
    for name in COLUMNS:
        if bare.count(name) > 1 or (name in bare and f"{name}.1" in bare):
            raise InvalidLogError(f"{path}: column {name} is there twice; keep one, or rename the other")


def write_run(run: Run, path: str | Path) -> None:
    """Writes one run to a path as CSV (nine digits, SI), absent columns left out.

    Raises:
        OutputError: it cannot be written.

    Examples:
        >>> write_run(read_run("logs/monday/run_0.csv").rows(0, 100), "first_second.csv")
    """
    write_columns({name: values for name in COLUMNS if (values := run.column(name)) is not None}, path)


def read_case(folder: str | Path) -> list[Run]:
    """Reads all runs (`run_*.csv`, `.csv.gz` or `.parquet`, in the order of their numbers) of one case, or a file's.

    Raises:
        InvalidLogError: no such folder, no runs in it, or one of them cannot be used.

    Examples:
        >>> [run.name for run in read_case("logs/monday")]
        ['run_0']
    """
    return [read_run(path) for path in case_paths(folder)]


def case_paths(folder: str | Path) -> list[Path]:
    """Files of all runs of one case, in the order of their numbers; InvalidLogError where there are none."""
    folder = Path(folder)
    if not folder.exists():
        raise InvalidLogError(f"{folder}: no such folder; a case is a folder of run_0.csv, run_1.csv, ...")
    if not folder.is_dir():
        check_file(folder, InvalidLogError, "give a run, or a folder of runs")
    paths = run_paths(folder)
    if not paths:
        raise InvalidLogError(f"{folder}: holds no runs; a case is a folder of run_0.csv, run_1.csv, ...")
    for first, second in itertools.pairwise(paths):
        if _name(first) == _name(second):
            raise InvalidLogError(
                f"{folder}: {first.name} and {second.name} are both {_name(first)}; keep one, or number them apart"
            )
    return paths


def run_paths(folder: Path) -> list[Path]:
    """Files of a case folder that hold runs, in the order of their numbers; a file is a case of one run."""
    if folder.is_file():
        return [folder]
    paths = [path for path in folder.glob("run_*") if path.name.endswith((".csv", ".csv.gz", ".parquet"))]

    def order(path: Path) -> tuple[int, str]:
        number = _name(path).removeprefix("run_")
        return (int(number) if number.isdigit() else 10**9, path.name)

    return sorted(paths, key=order)


def _name(path: Path) -> str:
    """The file's name without its ending."""
    return Path(path.name.removesuffix(".gz")).stem


def _recorded_name(path: Path) -> str:
    """The name of the recording's run that an import wrote to this file; the file's own where there was none."""
    own = _name(path)
    try:
        name = _import_report(path)["runs"][int(own.removeprefix("run_"))]["name"]
    except (InvalidLogError, KeyError, IndexError, TypeError, ValueError):
        return own
    return name if isinstance(name, str) and name else own


def _numbers(path: Path, name: str, values: "pd.Series[Any]") -> np.ndarray:
    from drift_drake.car.log.numbers import as_numbers, without_endless  # slow to import

    numbers = as_numbers(values).to_numpy(dtype=float)
    bad = np.flatnonzero(np.isnan(without_endless(numbers)))
    if len(bad):
        row, found = int(bad[0]), values.iloc[int(bad[0])]
        found = repr(found) if isinstance(found, str) else str(found)
        raise InvalidLogError(
            f"{path}: column {name} holds {found} in row {row + 2} ({len(bad)} such rows); "
            "fill or cut them, or leave the column out"
        )
    return numbers


def _check(run: Run) -> None:
    count = len(run.t)
    if count < SHORTEST_RUN:
        raise InvalidLogError(f"{run.name}: {count} rows; a run needs at least {SHORTEST_RUN}")
    for name in COLUMNS:
        values = run.column(name)
        if values is None:
            continue
        if values.shape != (count,):
            raise InvalidLogError(
                f"{run.name}: column {name} has shape {values.shape}; give one number a row ({count})"
            )
        if not np.all(np.isfinite(values)):
            row = int(np.flatnonzero(~np.isfinite(values))[0])
            raise InvalidLogError(f"{run.name}: column {name} is not a number in row {row}; fill or cut it")
    _check_clock(run)
    wrong = implausible({name: run.column(name) for name in COLUMNS}, run.period, run.trusted)
    if wrong is not None:
        raise InvalidLogError(f"{run.name}: {wrong}")


def _check_clock(run: Run) -> None:
    steps = np.diff(run.t)
    if np.any(steps <= 0.0):
        row = int(np.flatnonzero(steps <= 0.0)[0]) + 1
        raise InvalidLogError(
            f"{run.name}: the clock does not advance at row {row} (t = {run.t[row]:g} s after {run.t[row - 1]:g} s); "
            "sort the rows or split the run there"
        )
    period = float(np.median(steps))
    late = np.abs(steps - period) > PERIOD_TOLERANCE * period
    if np.any(late):
        row = int(np.flatnonzero(late)[0]) + 1
        raise InvalidLogError(
            f"{run.name}: the clock is irregular at row {row} (a step of {steps[row - 1]:g} s among steps of "
            f"{period:g} s); resample the run to a fixed period"
        )
    if period > (1.0 + PERIOD_TOLERANCE) * LONGEST_PERIOD:
        guess = "; it looks like milliseconds, convert t" if period >= 1.0 else ""
        raise InvalidLogError(
            f"{run.name}: a row each {period:g} s is too coarse; log at 20 Hz or faster (0.01 s){guess}"
        )


def import_report_path(folder: str | Path) -> Path:
    """Of what an import wrote next to the runs of a case folder, or next to a single run's file."""
    folder = Path(folder)
    return (folder.parent if folder.is_file() else folder) / IMPORT_REPORT


def _import_report(folder: str | Path) -> dict[str, Any]:
    """What an import wrote next to its runs (or next to a run, given its file); empty where there is none."""
    path = import_report_path(folder)
    if not path.exists():
        return {}
    remedy = "take it away or import again"
    report = parse_json(read_text(path, InvalidLogError, remedy), InvalidLogError, str(path), remedy, strict=False)
    if not isinstance(report, dict):
        raise _no_report(path)
    return report


def _no_report(path: Path) -> InvalidLogError:
    return InvalidLogError(f"{path}: is no report of 'drift-drake import'; take it away or import again")


def trusted_columns(folder: str | Path) -> tuple[str, ...]:
    """Columns that `drift-drake import --trust` was asked to trust; none where nothing was imported."""
    mapping = _import_report(folder).get("mapping", {})
    trusted = mapping.get("trust", []) if isinstance(mapping, dict) else None
    if not isinstance(trusted, list) or not all(name in COLUMNS for name in trusted):
        raise _no_report(import_report_path(folder))
    return tuple(trusted)


def stated_noise(folder: str | Path) -> dict[str, float]:
    """Noise levels by column (SI, one standard deviation) that an import stated with its runs; none without one.

    The median over the runs. A smoothed column hides its noise from whoever looks at its rows alone.
    """
    levels: dict[str, list[float]] = {}
    try:
        whole = _import_report(folder)
        for report in whole["runs"] if whole else []:
            for name, value in report["std"].items():
                levels.setdefault(str(name), []).append(number(value, lambda level: 0.0 <= level < ABSURD))
    except (ValueError, KeyError, TypeError, AttributeError):
        raise _no_report(import_report_path(folder)) from None
    return {name: float(np.median(values)) for name, values in levels.items()}
