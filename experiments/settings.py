"""A folder of results is gone on with by the settings that it was begun with."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.run_folder import is_done, plain, write_json


class OtherExperimentError(DriftDrakeError, ValueError):
    """A folder that holds runs of another experiment; the message names it and what differs."""


def keep_settings(folder: Path, settings: Mapping[str, Any], free: Sequence[str]) -> None:
    """Writes config.json; settings that are `free` may change from call to call.

    Raises:
        OtherExperimentError: the results there were made with others.
    """
    path, entry = folder / "config.json", plain(settings)
    before = json.loads(path.read_text()) if is_done(path) else {}
    differ = [name for name in before if name not in free and before[name] != entry.get(name)]
    if differ:
        raise OtherExperimentError(
            f"{folder} holds runs made with another {', '.join(differ)}; give another folder, or the settings of {path}"
        )
    write_json(path, entry)
