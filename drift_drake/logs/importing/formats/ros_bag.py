"""Bags of ROS 2 (a folder with metadata.yaml; SQLite or MCAP inside) and ROS 1 (.bag)."""

from pathlib import Path

from drift_drake.logs.importing.formats.topics import Topic, topics_of_messages


def bag_of(path: Path) -> Path:
    """The bag's folder where one of its files is given."""
    return path.parent if path.suffix == ".db3" else path


def read_bag(path: Path) -> list[Topic]:
    """All topics whose message types are known.

    Raises:
        ValueError: no bag, or no message that can be read; ImportError: `rosbags` is not installed; OSError.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    try:
        with AnyReader([bag_of(path)], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            known = [item for item in reader.connections if item.msgtype in reader.typestore.fielddefs]
            topics = topics_of_messages(
                (connection.topic, time, reader.deserialize(data, connection.msgtype))
                for connection, time, data in reader.messages(known)
            )
    except AnyReaderError as error:
        raise ValueError(str(error)) from None
    if not topics:
        raise ValueError("holds no messages of a known type; record the bag with its message definitions (MCAP)")
    return topics
