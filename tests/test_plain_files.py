"""YAML and JSON of unknown origin: what is refused, and in which words."""

import os
from pathlib import Path

import pytest

from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.plain_files import parse_json, parse_yaml, read_text


class RefusedError(DriftDrakeError):
    """Of this test."""


BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join(['*' + a] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: 1\nb: 2\na: 3\n", "not valid YAML at line 3: the key 'a' twice"),
        ("a: {b: 1, b: 2}\n", "the key 'b' twice"),
        (BOMB, "aliases of aliases"),
        ("a: &a [*a]\n", "aliases of aliases"),
        ("[" * 5000, "not"),
        ("a: 2001-99-99\n", "not YAML that can be read"),
        ("a: [1\n", "not valid YAML at line"),
        ("a: !!python/object:os.system {}\n", "not valid YAML"),
    ],
)
def test_yaml_is_refused(text: str, says: str) -> None:
    with pytest.raises(RefusedError, match=says) as caught:
        parse_yaml(text, RefusedError, "f", "correct it")
    assert len(str(caught.value)) < 300


def test_yaml_with_anchors_is_read() -> None:
    text = "base: &b {x: 1, y: 2}\nother: {<<: *b, y: 3}\n"
    assert parse_yaml(text, RefusedError, "f", "") == {"base": {"x": 1, "y": 2}, "other": {"x": 1, "y": 3}}
    assert parse_yaml("", RefusedError, "f", "") is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"a": 1, "a": 2}', "the key 'a' twice"),
        ('{"a": NaN}', "'NaN', which is no finite number"),
        ('{"a": 1e999}', "which is no finite number"),
        ("[" * 100_000, "not JSON"),
        ('{"a"', "not JSON"),
        ("", "not JSON"),
        ('{"a": ' + "1" * 5000 + "}", "not JSON that can be read"),
    ],
)
def test_json_is_refused(text: str, says: str) -> None:
    with pytest.raises(RefusedError, match=says):
        parse_json(text, RefusedError, "f", "correct it")


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "latin").write_bytes(b"mass: 1 # \xe9\n")
    (tmp_path / "large").write_bytes(b"x" * 100)
    for name, says in (
        ("pipe", "a pipe or device"),
        (".", "it is a folder"),
        ("latin", "not a text file"),
        ("none", "No such file"),
        ("large", "100 bytes"),
        ("nul\0", "cannot be read"),
    ):
        with pytest.raises(RefusedError, match=says):
            read_text(tmp_path / name, RefusedError, "correct it", 50)
