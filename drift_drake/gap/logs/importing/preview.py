"""An import before it is made: what looks wrong in a recording with a mapping as it stands, and what would fix it."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError
from drift_drake.gap.logs.importing.checks import doubts_of
from drift_drake.gap.logs.importing.fixes import Fix, fixes, fixes_of_refusal
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.importer import PERIOD, Piece, as_run, pieces_of
from drift_drake.gap.logs.importing.mapping import RecorderMapping, mapping_from_dict
from drift_drake.gap.logs.importing.recording import read_recording


@dataclasses.dataclass(frozen=True)
class Remark:
    """A sentence on what looks wrong, and ways to put it right."""

    sentence: str
    fixes: list[Fix] = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True)
class Preview:
    """What an import would say of a recording.

    pieces: columns of the log [rows] by run, at `PERIOD` [s]; remarks: on what looks wrong; refused: why the import
    would be refused, None where it would not; unchecked: columns that no other column can check; undecided: what
    else they cannot tell.
    """

    pieces: list[Mapping[str, Array]]
    remarks: list[Remark]
    refused: Remark | None
    unchecked: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()


def preview(
    path: str | Path, topics: Sequence[Topic], data: Mapping[str, Any], start: float = 0.0, end: float = math.inf
) -> Preview:
    """What an import of one recording would say.

    Args:
        topics: what the file holds; data: the mapping as plain data; start, end: part to look at [s].
    """
    try:
        mapping = mapping_from_dict(dict(data), "mapping.yaml")
        recording = read_recording(path, mapping, (), topics)
        pieces, _, said = pieces_of(Path(path), recording.name, recording, mapping, start, end)
        doubts, wrong = doubts_of([(piece.label, piece.columns) for piece in pieces], PERIOD, mapping)
    except DriftDrakeError as error:
        return Preview([], [], Remark(str(error)))
    sentences = dict.fromkeys([*said, *(one for several in wrong.values() for one in several)])
    remarks = [
        Remark(one, fixes(doubts.suspicions[one], data) if one in doubts.suspicions else []) for one in sentences
    ]
    return Preview(
        [piece.columns for piece in pieces],
        remarks,
        _refused(pieces, mapping, data),
        doubts.unchecked,
        doubts.undecided,
    )


def _refused(pieces: Sequence[Piece], mapping: RecorderMapping, data: Mapping[str, Any]) -> Remark | None:
    try:
        for piece in pieces:
            as_run(piece, mapping, ())
    except DriftDrakeError as error:
        return Remark(str(error), fixes_of_refusal(str(error), data))
    return None
