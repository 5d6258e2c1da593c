"""A recorder's file to its topics, by the file's ending."""

import importlib
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from drift_drake.logs.importing.formats.topics import Topic, with_yaw
from drift_drake.logs.table import InvalidLogError
from drift_drake.plain_files import check_file

READERS = {  # of an ending: module, function, what the format is called, the extra that it needs
    ".csv": ("tables", "read_csv", "CSV", ""),
    ".parquet": ("tables", "read_parquet", "Parquet", "parquet"),
    ".mcap": ("topics", "read_mcap", "MCAP", "ros"),
    ".bag": ("topics", "read_bag", "ROS bags", "ros"),
    ".db3": ("topics", "read_bag", "ROS bags", "ros"),
    ".mf4": ("tables", "read_mdf", "MDF", "mdf"),
    ".mdf": ("tables", "read_mdf", "MDF", "mdf"),
    ".dat": ("tables", "read_mdf", "MDF", "mdf"),
    ".mat": ("tables", "read_mat", "MATLAB files", "matlab"),
    ".npz": ("tables", "read_npz", "npz", ""),
    ".h5": ("tables", "read_hdf5", "HDF5", "hdf5"),
    ".hdf5": ("tables", "read_hdf5", "HDF5", "hdf5"),
}
KNOWN = "CSV, Parquet, MCAP, ROS bags, MDF4, MATLAB .mat, .npz or HDF5"


class InvalidRecordingError(InvalidLogError):
    """A recording that cannot be used; the message names the file, the place and the remedy."""


def read_topics(path: str | Path) -> list[Topic]:
    """All topics of a recorder's file, or of the folder of a ROS 2 bag.

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
    module, function, title, extra = READERS[".bag" if bag else _ending(path)]
    reader: Callable[[Path], list[Topic]] = getattr(
        importlib.import_module(f"drift_drake.logs.importing.formats.{module}"), function
    )
    try:
        topics = reader(path)
    except ImportError:
        raise InvalidRecordingError(
            f"{path}: {title} need{'s' if title[-1] != 's' else ''} a package that is not installed; "
            f"pip install 'drift_drake[{extra}]'"
        ) from None
    except pd.errors.EmptyDataError:
        raise InvalidRecordingError(f"{path}: the file is empty; a recording needs a header and rows") from None
    except MemoryError:  # for `logs.apart` to say
        raise
    except Exception as error:  # the readers' own classes on a broken file are too many to name
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise InvalidRecordingError(f"{path}: cannot be read as {title} ({reason}); give {KNOWN}") from None
    if not any(len(topic.table) for topic in topics):
        raise InvalidRecordingError(f"{path}: the file has a header and no rows; give a recording with readings")
    return [Topic(topic.name, with_yaw(topic.table), topic.units) for topic in topics if len(topic.table)]


def _ending(path: Path) -> str:
    """The file's ending where a reader knows it; text of another ending is taken for CSV."""
    ending = path.suffix.lower()
    return ending if ending in READERS else ".csv"
