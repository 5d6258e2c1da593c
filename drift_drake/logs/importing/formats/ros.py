"""MCAP files with messages of ROS 2 (cdr) or JSON, and bags of ROS 2 (a folder with metadata.yaml) and ROS 1 (.bag)."""

import json
from pathlib import Path
from typing import Any

from drift_drake.logs.importing.formats.topics import Topic, topics_of_messages


def read_mcap(path: Path) -> list[Topic]:
    """All topics whose messages can be decoded.

    Raises:
        ValueError: no message can be; ImportError: `mcap` is not installed; OSError.
    """
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    factory = DecoderFactory()  # type: ignore[no-untyped-call]
    decoders: dict[int, Any] = {}
    messages: list[tuple[str, int, Any]] = []
    unread: set[str] = set()
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            if channel.id not in decoders:
                json_read = channel.message_encoding == "json"
                decoders[channel.id] = (
                    json.loads if json_read else factory.decoder_for(channel.message_encoding, schema)
                )
            decode = decoders[channel.id]
            if decode is None:
                unread.add(f"{channel.topic} ({channel.message_encoding})")
                continue
            messages.append((channel.topic, message.log_time, decode(message.data)))
    if not messages:
        found = f"; its topics are {', '.join(sorted(unread))}" if unread else ""
        raise ValueError(f"holds no messages of ROS 2 (cdr) or JSON{found}")
    return topics_of_messages(messages)


def read_bag(path: Path) -> list[Topic]:
    """All topics whose message types are known.

    Raises:
        ValueError: no bag, or no message that can be read; ImportError: `rosbags` is not installed; OSError.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    try:
        # Of a ROS 2 bag one of the files in its folder may be given.
        bag = path.parent if path.suffix == ".db3" else path
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
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
