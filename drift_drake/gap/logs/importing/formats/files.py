"""A recorder's file to its topics, by its first bytes or its ending."""

import dataclasses
import importlib
from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from drift_drake.car.log.table import InvalidLogError
from drift_drake.common.errors import MissingExtraError
from drift_drake.common.plain_files import check_file
from drift_drake.gap.logs.importing.formats.known_formats import BAG, Format, format_of, refused
from drift_drake.gap.logs.importing.formats.topics import NeededError, Topic, with_yaw

KNOWN = (
    "CSV, Parquet, MCAP, ROS bags, MDF, MATLAB .mat, .npz, HDF5, VBOX .vbo, AiM .xrk, PX4 .ulg or CAN frames "
    "(candump, .asc, .blf, .trc)"
)


class InvalidRecordingError(InvalidLogError):
    """A recording that cannot be used; the message names the file, the place and the remedy."""


def read_topics(path: str | Path, databases: Sequence[str | Path] = ()) -> list[Topic]:
    """All topics of a recorder's file, or of the folder of a ROS 2 bag.

    Args:
        databases: of CAN messages (DBC), by which raw frames are decoded.

    Raises:
        InvalidRecordingError: no such file, a format that is not known or not installed, or nothing in it.
    """
    path = Path(path)
    bag = path.is_dir() and (path / "metadata.yaml").is_file()
    if not path.exists():
        raise InvalidRecordingError(f"{path}: no such file; give recordings as {KNOWN}")
    if path.is_dir() and not bag:
        raise InvalidRecordingError(f"{path}: is a folder and no ROS 2 bag (no metadata.yaml); give {KNOWN}")
    if not bag:
        check_file(path, InvalidRecordingError, f"give recordings as {KNOWN}")
        if (way := refused(path)) is not None:
            raise InvalidRecordingError(f"{path}: is {way[0]}, which is not read; {way[1]}")
    topics = _read(path, BAG if bag else format_of(path), tuple(Path(name) for name in databases))
    if not any(len(topic.table) for topic in topics):
        raise InvalidRecordingError(f"{path}: the file has a header and no rows; give a recording with readings")
    return [dataclasses.replace(topic, table=with_yaw(topic.table)) for topic in topics if len(topic.table)]


def _read(path: Path, form: Format, databases: tuple[Path, ...]) -> list[Topic]:
    module, function, title, extra, decoded = form
    reader: Callable[..., list[Topic]] = getattr(
        importlib.import_module(f"drift_drake.gap.logs.importing.formats.{module}"), function
    )
    for database in databases if decoded else ():
        check_file(database, InvalidRecordingError, "give --dbc a database of CAN messages")
    try:
        return reader(path, databases) if decoded else reader(path)
    except ImportError as error:
        missing = MissingExtraError(f"reading {title}", error.name or "a package", extra)
        raise InvalidRecordingError(f"{path}: {missing}") from None
    except pd.errors.EmptyDataError:
        raise InvalidRecordingError(f"{path}: the file is empty; a recording needs a header and rows") from None
    except NeededError as error:
        raise InvalidRecordingError(f"{path}: {error}") from None
    except MemoryError:  # for `common.apart` to say
        raise
    except Exception as error:  # the readers' own classes on a broken file are too many to name
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise InvalidRecordingError(f"{path}: cannot be read as {title} ({reason}); give {KNOWN}") from None
