"""Makes a picture of the documentation.

    python -m experiments.pictures effects_map --out docs/effects_map.png

Each takes some seconds, and the first one of a machine the compilation too; demo, replay and report, which a headless
Chromium photographs, a minute or two; still some minutes; figure_8 half an hour of CPU.
"""

import dataclasses
import importlib
from pathlib import Path

import tyro

from diagrams.command import run_command
from drift_drake.common.errors import InvalidOptionError
from experiments.pictures import Name

SOURCED = ("demo", "figure_8", "still")


@dataclasses.dataclass(frozen=True)
class PicturesConfig:
    """What is made."""

    name: tyro.conf.Positional[Name]
    """Of the picture: of a module of this folder."""
    out: Path | None = None
    """PNG or SVG (diagnosis: GIF, with a still next to it); docs/NAME.png without."""
    source: Path | None = None
    """demo, figure_8, still: folder of runs that the picture is of; they are made without."""


def main(config: PicturesConfig) -> None:
    """Makes it.

    Raises:
        InvalidOptionError: a source of a picture that has none.
    """
    if config.source and config.name not in SOURCED:
        raise InvalidOptionError(f"--source: {config.name} is of no folder; leave it out")
    module = importlib.import_module(f"experiments.pictures.{config.name}")
    source = [config.source] if config.source else []
    out = config.out or Path("docs") / f"{config.name}.{'gif' if hasattr(module, 'animate') else 'png'}"
    if hasattr(module, "animate"):
        module.animate(out)
    elif hasattr(module, "take"):
        module.take(out, *source)
    else:
        from drift_drake.view.style import save

        save(module.draw(*source), out)
    print(out)


if __name__ == "__main__":
    run_command(main, PicturesConfig, __doc__)
