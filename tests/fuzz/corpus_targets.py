"""What reads the texts of the kept corpus: a folder of `tests/fuzz/corpus` each."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from drift_drake.car.log.table import read_run, stated_noise, trusted_columns
from drift_drake.car.vehicle_file import read_vehicle
from drift_drake.gap.diagnosis.answers.answer import read_answer
from drift_drake.gap.identification.calibration import read_trust
from drift_drake.gap.logs.importing.mapping import read_mapping

CORPUS = Path(__file__).parent / "corpus"


def _report(path: Path) -> None:
    """As the runs next to it are read."""
    trusted_columns(path.parent)
    stated_noise(path.parent)


def _answer(path: Path) -> None:
    read_answer(path).sentence()


TARGETS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "answer": (".json", _answer),
    "calibration": (".json", read_trust),
    "import_report": (".json", _report),
    "log": (".csv", read_run),
    "mapping": (".yaml", read_mapping),
    "vehicle": (".yaml", read_vehicle),
}
