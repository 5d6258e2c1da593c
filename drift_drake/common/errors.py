"""The class above all refusals: input, options and outputs that cannot be used, each said in one sentence."""

import difflib
import re
import reprlib
from collections.abc import Iterable
from decimal import Decimal
from typing import Any

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxdict = _SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxset = 4
_SHORT.maxlevel = 2
LONGEST_LINE = 2000  # characters of a message on one line
COLOURS = re.compile(r"\x1b\[[0-9;]*m")
LAST = 400  # of them that are its end, where the reason and the remedy stand


class DriftDrakeError(Exception):
    """Something given that cannot be used; the message names it, the place and the remedy in one sentence.

    Examples:
        >>> try:
        ...     read_vehicle("missing.yaml")
        ... except DriftDrakeError as error:
        ...     print(str(error).split(":")[0])
        missing.yaml
    """


class InvalidOptionError(DriftDrakeError, ValueError):
    """An option of a command out of its range; the message names the option and the range."""


class OutputError(DriftDrakeError, OSError):
    """An output that cannot be written; the message names the file and the remedy."""


class MissingExtraError(DriftDrakeError, ImportError):
    """Something is asked for that needs a package of an extra which is not installed."""

    def __init__(self, what: str, package: str, extra: str) -> None:
        super().__init__(f"{what} needs {package}; install the extra: pip install 'drift_drake[{extra}]'")


def shown(value: Any) -> str:
    """A value as a message shows it: on one line and short, however large or nested it is."""
    return _SHORT.repr(value)


def one_line(error: BaseException) -> str:
    """An error's message on one line of bounded length, without the terminal's codes of colour that libraries write."""
    text = " ".join(COLOURS.sub("", str(error)).split())
    return text if len(text) <= LONGEST_LINE else f"{text[: LONGEST_LINE - LAST]} ... {text[-LAST:]}"


def unit_suffix(unit: str) -> str:
    """A unit as it follows a number in a sentence; nothing for a number without one ("-")."""
    return "" if unit == "-" else f" {unit}"


def meant(name: str, known: Iterable[str]) -> str:
    """What a mistyped name was meant to be, or else all that are known, to end a message with."""
    known = list(known)
    near = difflib.get_close_matches(name, known, 2)
    return f"did you mean {' or '.join(near)}?" if near else f"choose from {', '.join(known)}"


def significant(value: float, digits: int = 3) -> str:
    """A number in so many significant digits, never as a power of ten."""
    return format(Decimal(f"{value:.{digits}g}"), "f")
