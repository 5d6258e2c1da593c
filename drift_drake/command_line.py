"""The command line that a command was given by, for reports."""

import dataclasses
import shlex
from typing import Any


def command_line(name: str, command: Any, positional: str) -> str:
    """`drift-drake NAME ...` with the options that differ from their defaults.

    Args:
        command: a command's dataclass; positional: its field that is given without a name.
    """
    words = ["drift-drake", name, *_words(getattr(command, positional))]
    for field in dataclasses.fields(command):
        value = getattr(command, field.name)
        if field.name == positional or value == field.default:
            continue
        option = "--" + field.name.replace("_", "-")
        if isinstance(value, bool):
            words.append(option if value else option.replace("--", "--no-", 1))
        else:
            words += [option, *_words(value)]
    return shlex.join(words)


def _words(value: Any) -> list[str]:
    return list(map(str, value)) if isinstance(value, tuple) else [str(value)]
