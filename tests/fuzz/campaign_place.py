"""Where a trial of the campaign is: its folder, good inputs, and earlier trials' inputs."""

import json
from collections.abc import Generator
from pathlib import Path
from random import Random

import yaml
from as_command import Ended
from hostile import spoilt_bytes, spoilt_tree

QUICK = ("--effects", "steering_lag", "aero_drag", "--workers", "1", "--quiet")
Trial = Generator[tuple[str | Path, ...], Ended, None]
"""Yields the words of a command, and is sent how it ended."""


class Place:
    """A trial's folder, the good inputs, and those of earlier trials that were answered in a way of their own."""

    def __init__(self, folder: Path, seeds: Path, corpus: Path) -> None:
        self.folder, self.seeds, self.corpus = folder, seeds, corpus
        self.subjects: list[tuple[str, Path]] = []

    def put(self, name: str, content: bytes, kind: str = "") -> str:
        """Writes a file; kind: of what a trial is about, kept if its answer is a new one."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        if kind:
            self.subjects.append((kind, path))
        return name

    def start(self, rng: Random, kind: str) -> Path:
        """A good input, or an earlier trial's."""
        kept = sorted((self.corpus / kind).glob("*")) if rng.random() < 0.4 else []
        return rng.choice(kept or sorted(path for path in (self.seeds / kind).rglob("*") if path.is_file()))

    def structure(self, rng: Random, kind: str) -> bytes:
        """Plain data spoilt by structure, or by bytes."""
        content = self.start(rng, kind).read_bytes()
        if rng.random() < 0.3:
            return spoilt_bytes(rng, content)
        try:
            data = yaml.safe_load(content)
        except (yaml.YAMLError, ValueError, RecursionError):
            return spoilt_bytes(rng, content)
        return dumped(spoilt_tree(rng, data), kind)

    def good(self, kind: str, name: str) -> bytes:
        return (self.seeds / kind / name).read_bytes()


def dumped(data: object, kind: str) -> bytes:
    as_json = kind in ("answer", "calibration", "report")
    text = json.dumps(data) if as_json else yaml.safe_dump(data, sort_keys=False, allow_unicode=True)
    return text.encode("utf-8", "surrogatepass")
