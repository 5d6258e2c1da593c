"""Draws a picture of the documentation.

    python -m experiments.pictures effects_map --out docs/effects_map.png

Each takes some seconds, and the first one of a machine the compilation too.
"""

import dataclasses
import importlib
from pathlib import Path

import tyro

from diagrams.command import run_command
from experiments.pictures import Name


@dataclasses.dataclass(frozen=True)
class PicturesConfig:
    """What is drawn."""

    name: tyro.conf.Positional[Name]
    """Of the picture: of a module of this folder."""
    out: Path | None = None
    """PNG or SVG (diagnosis: GIF, with a still next to it); docs/NAME.png without."""


def main(config: PicturesConfig) -> None:
    """Draws it."""
    module = importlib.import_module(f"experiments.pictures.{config.name}")
    ending = "gif" if hasattr(module, "animate") else "png"
    out = config.out or Path("docs") / f"{config.name}.{ending}"
    if ending == "gif":
        module.animate(out)
    else:
        from drift_drake.view.style import save

        save(module.draw(), out)
    print(out)


if __name__ == "__main__":
    run_command(main, PicturesConfig, __doc__)
