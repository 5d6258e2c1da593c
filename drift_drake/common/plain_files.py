"""Reading YAML and JSON files that someone else may have made: bounded, no key twice, every flaw one sentence."""

import json
import math
import stat
import zipfile
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any

import yaml

from drift_drake.common.errors import DriftDrakeError, shown

LARGEST_YAML = 256 * 1024  # bytes: vehicle files and mappings have a few thousand
LARGEST_JSON = 64 * 1024 * 1024  # bytes
MOST_NODES = 20_000  # of a YAML file with its aliases written out


def check_file(path: str | Path, error: type[DriftDrakeError], remedy: str, largest: float = math.inf) -> None:
    """Sees that a path is a file's: a pipe would be waited for without end.

    Raises:
        error: there is none, it is no regular file, or it is larger than `largest` bytes.
    """
    try:
        status = Path(path).stat()
    except (OSError, ValueError) as reason:
        raise error(f"{path}: cannot be read ({_reason(reason)}); {remedy}") from None
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "a pipe or device"
        raise error(f"{path}: cannot be read (it is {kind}, no file); {remedy}")
    if status.st_size > largest:
        raise error(f"{path}: has {status.st_size} bytes, more than such a file can need; {remedy}")


def check_archive(path: str | Path, error: type[DriftDrakeError], remedy: str, largest: float) -> None:
    """Sees that the arrays of an .npz file are no larger than `largest` bytes when they are unpacked.

    Raises:
        error: they are; zipfile.BadZipFile, OSError: no archive.
    """
    with zipfile.ZipFile(path) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > largest:
        raise error(f"{path}: unpacks to {size} bytes, more than such a file can need; {remedy}")


def read_text(path: str | Path, error: type[DriftDrakeError], remedy: str, largest: float = LARGEST_JSON) -> str:
    """The text of a file in UTF-8; raises `error` where it cannot be read, or is no text."""
    check_file(path, error, remedy, largest)
    try:
        return Path(path).read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise error(f"{path}: not a text file; {remedy}") from None
    except OSError as reason:
        raise error(f"{path}: cannot be read ({_reason(reason)}); {remedy}") from None


def read_json(path: str | Path, error: type[DriftDrakeError], remedy: str) -> Any:
    """The content of a JSON file; numbers that are not finite are refused.

    Raises:
        error: it cannot be read, is no JSON, or has a key twice.
    """
    return parse_json(read_text(path, error, remedy), error, str(path), remedy)


def parse_json(text: str, error: type[DriftDrakeError], source: str, remedy: str, strict: bool = True) -> Any:
    """The content of a JSON text; see `read_json`. Not `strict`, NaN and infinite numbers are let through."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        out = dict(pairs)
        if len(out) < len(pairs):
            keys = [key for key, _ in pairs]
            twice = next(key for key in keys if keys.count(key) > 1)
            raise error(f"{source}: holds the key {shown(twice)} twice; {remedy}")
        return out

    def finite(number: str) -> float:
        value = float(number)
        if strict and not math.isfinite(value):
            raise error(f"{source}: holds {shown(number)}, which is no finite number; {remedy}")
        return value

    try:
        return json.loads(text, object_pairs_hook=unique, parse_constant=finite, parse_float=finite)
    except json.JSONDecodeError as reason:
        raise error(f"{source}: not JSON (line {reason.lineno}); {remedy}") from None
    except (RecursionError, ValueError) as reason:
        if isinstance(reason, error):
            raise
        raise error(f"{source}: not JSON that can be read ({shown(str(reason))}); {remedy}") from None


class _Loader(yaml.SafeLoader):
    """Refuses a key that a mapping holds twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        for key, _ in node.value:
            if key.tag == "tag:yaml.org,2002:merge" or not isinstance(key, yaml.ScalarNode):
                continue
            if key.value in seen:
                raise yaml.constructor.ConstructorError(None, None, f"the key {shown(key.value)} twice", key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def parse_yaml(text: str, error: type[DriftDrakeError], source: str, remedy: str) -> Any:
    """The content of a YAML text.

    Raises:
        error: no YAML, a key twice, or aliases that write out to more than `MOST_NODES` entries.
    """
    if len(text) > LARGEST_YAML:
        raise error(f"{source}: has {len(text)} characters, more than such a file can need; {remedy}")
    try:
        loader = _Loader(text)
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            if _written_out(node, {}) > MOST_NODES:
                raise error(f"{source}: holds more entries than such a file can need, or aliases of aliases; {remedy}")
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except yaml.YAMLError as reason:
        mark = getattr(reason, "problem_mark", None)
        line = f" at line {mark.line + 1}" if mark else ""
        problem = getattr(reason, "problem", None)
        twice = f": {problem}" if problem and problem.endswith("twice") else ""
        raise error(f"{source}: not valid YAML{line}{twice}; {remedy}") from None
    except (RecursionError, ValueError, OverflowError, TypeError, AttributeError) as reason:
        if isinstance(reason, error):
            raise
        raise error(f"{source}: not YAML that can be read ({shown(str(reason))}); {remedy}") from None


def _written_out(node: yaml.Node, known: dict[int, float]) -> float:
    """Entries below a node with its aliases written out; infinite where one holds itself."""
    if isinstance(node, yaml.ScalarNode):
        return 1.0
    if id(node) not in known:
        known[id(node)] = math.inf  # until it is known: met again within itself, it has no end
        children: list[yaml.Node] = (
            [part for pair in node.value for part in pair] if isinstance(node, yaml.MappingNode) else node.value
        )
        known[id(node)] = 1.0 + sum(_written_out(child, known) for child in children)
    return known[id(node)]


def number(value: Any, check: Callable[[float], bool] = math.isfinite) -> float:
    """A value as a finite number for which `check` holds; raises ValueError where it is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{shown(value)} is no number")
    try:
        out = float(value)
    except OverflowError:
        out = math.inf
    if not math.isfinite(out) or not check(out):
        raise ValueError(f"{shown(value)} is out of range")
    return out


def named_number(name: str, value: Any, check: Callable[[float], bool] = math.isfinite, remedy: str = "") -> float:
    """The same of a value with a name, which the error's message begins with."""
    try:
        return number(value, check)
    except ValueError as error:
        raise ValueError(f"{name}: {error}{remedy}") from None


def _reason(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)
