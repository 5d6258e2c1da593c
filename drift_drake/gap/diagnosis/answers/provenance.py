"""What an answer was found from: hashes of the logs, the vehicle file and the options, the version and the date."""

import hashlib
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import import_report_path, run_paths
from drift_drake.car.parameters import CarParameters
from drift_drake.car.vehicle_file import vehicle_hash
from drift_drake.common.run_folder import plain
from drift_drake.gap.diagnosis.answers.answer import Answer, InvalidAnswerError, read_answer

KEY = "provenance"  # of an answer's details
INPUTS = ("version", "vehicle_sha256", "logs_sha256", "options_sha256")  # that the same answer follows from


def provenance(folder: str | Path, vehicle: CarParameters, options: Mapping[str, Any]) -> dict[str, Any]:
    """What identifies a diagnosis of a case folder, as plain data; `options` are those of `diagnose`."""
    folder, own = Path(folder), options.get("own", Effects())
    others = {name: value for name, value in options.items() if name not in ("own", "progress")}
    files = [*run_paths(folder), *(path for path in [import_report_path(folder)] if path.is_file())]
    settings = json.dumps(plain(others), sort_keys=True, default=str)
    return {
        "version": version("drift_drake"),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "folder": str(folder.resolve()),
        "vehicle_sha256": vehicle_hash(vehicle, own),
        "logs_sha256": {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files if path.is_file()},
        "options_sha256": hashlib.sha256(settings.encode()).hexdigest(),
    }


def answered(path: Path, wanted: Mapping[str, Any]) -> Answer | None:
    """The answer in a file if it was found from what is wanted; None where there is none, or a damaged or older one.

    Raises:
        InvalidAnswerError: the file is the answer to another case, which writing would lose.
    """
    try:
        answer = read_answer(path)
    except InvalidAnswerError:
        return None
    found = answer.details.get(KEY)
    if not isinstance(found, dict):
        return None
    if all(found.get(key) == wanted[key] for key in INPUTS):
        return answer
    if found.get("folder") != wanted["folder"]:
        raise InvalidAnswerError(
            f"{path}: is the answer to the case in {found.get('folder')}, not to that in {wanted['folder']}; "
            "give --json another folder, or move that answer"
        )
    return None


def all_answered(
    answers: Mapping[Path, Path], vehicle: CarParameters, options: Mapping[str, Any]
) -> dict[Path, Answer]:
    """Of case folders and the files of their answers, the answers that are found already.

    Raises:
        InvalidAnswerError: a file is the answer to another case.
    """
    there = {folder: path for folder, path in answers.items() if path.exists()}
    found = {folder: answered(path, provenance(folder, vehicle, options)) for folder, path in there.items()}
    return {folder: answer for folder, answer in found.items() if answer is not None}


def check_diagnosed(answer: Answer, vehicle: CarParameters, own: Effects, source: str | Path) -> str | None:
    """Sees that an answer was found with this vehicle file.

    Returns:
        A warning where the answer does not say so (one written by an older version or by hand), else None.

    Raises:
        InvalidAnswerError: it was found with another vehicle file.
    """
    found = answer.details.get(KEY)
    if not isinstance(found, dict) or "vehicle_sha256" not in found:
        return f"the answer does not say which vehicle file it was found with; whether it was {source} is not checked"
    if found["vehicle_sha256"] != vehicle_hash(vehicle, own):
        raise InvalidAnswerError(
            f"{source}: is not the vehicle file that {answer.case} was diagnosed with (another car's, changed since, "
            "or with the answer's effects already in it); give that file, or diagnose again with this one"
        )
    return None
