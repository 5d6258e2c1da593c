"""One folder a run: config, numbers and versions as JSON, tables as CSV, figures as PNG."""

import dataclasses
import json
import math
import platform
import zipfile
from collections.abc import Mapping, Sequence
from datetime import datetime
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drift_drake.common.safe_files import replacing, write_table, write_text

if TYPE_CHECKING:
    import pandas as pd


PACKAGES = ("drift_drake", "drake", "numpy", "scipy", "numba", "osqp", "matplotlib")


def make_run_folder(name: str, out: Path | None = None) -> Path:
    """`out`, or a new folder runs/NAME-DATE-TIME below the working directory."""
    folder = out or Path("runs") / f"{name}-{datetime.now():%Y%m%d-%H%M%S}"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def write_json(path: Path, data: Any) -> None:
    """Anything that `plain` takes, as JSON."""
    write_text(path, to_json(data) + "\n")


def to_json(data: Any) -> str:
    """The text that `write_json` writes."""
    return json.dumps(plain(data), indent=2, allow_nan=False)


def is_done(path: Path) -> bool:
    """Whether a file of results (JSON or .npz) is there and whole: an empty or cut one is to be made again."""
    if path.suffix == ".npz":
        return path.is_file() and zipfile.is_zipfile(path)
    try:
        json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return True


def write_versions(folder: Path) -> None:
    """What the run ran on."""
    versions: dict[str, Any] = {package: version(package) for package in PACKAGES}
    write_json(folder / "versions.json", versions | {"python": platform.python_version(), "machine": machine()})


def machine() -> str:
    """The processor and the number of cores, for figures that depend on them."""
    model = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return f"{names[0]}, {len(names)} cores" if names else model


def plain(value: Any) -> Any:
    """Dataclasses, paths and NumPy's numbers and arrays as what JSON holds; what is not finite becomes None."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return plain(dataclasses.asdict(value))
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # of NumPy, which is slow to import
        return plain(value.tolist())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def write_results_table(folder: Path, rows: "Sequence[Mapping[str, Any]] | pd.DataFrame") -> Path:
    """Writes results.parquet, or results.csv where pyarrow is not installed, whole or not at all; returns its path.

    Args:
        rows: one for each result, by column; what one has and another lacks is empty there.

    Raises:
        OutputError: the file cannot be written.
    """
    import pandas as pd

    table = pd.DataFrame(rows)
    if find_spec("pyarrow") is None:
        write_table(table, folder / "results.csv", index=False)
        return folder / "results.csv"
    with replacing(folder / "results.parquet") as part:
        table.to_parquet(part, index=False)
    return folder / "results.parquet"
