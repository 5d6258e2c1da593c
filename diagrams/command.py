"""How `python -m diagrams.NAME` and `python -m experiments.FOLDER.NAME` begin and end.

Ctrl-C and SIGTERM end each in one line, from the imports on; what is done stays.
"""

import contextlib
import dataclasses
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from drift_drake.common.interruption import ended_at_once, leave_ends_to_the_system

NAME = next((word for word in sys.orig_argv if word.startswith(("diagrams.", "experiments."))), "experiments")
COUNTS = ("vehicles", "noise_seeds", "workers", "threads", "repeats", "loops", "cars", "cases", "seeds", "samples")
"""Options of which none would leave nothing to do."""
PICTURES = (".png", ".svg", ".gif", ".pdf")
_importing = contextlib.ExitStack()
if sys.argv[0] == "-m":  # as Python has it while it looks for the module that it is to run, and imports its packages
    _importing.enter_context(ended_at_once(f"{NAME}: "))


def run_command(main: Callable[..., object], options: Any = None, description: str | None = None) -> NoReturn:
    """Reads a module's options from the command line, runs its `main` with them and ends Python.

    Args:
        options: type of main's one argument, for `tyro.cli`; None where main's own parameters are the options.
    """
    import tyro

    from drift_drake.common.interruption import ended_well
    from drift_drake.common.safe_files import alone_in

    def run() -> int:
        if options is None:
            tyro.cli(main, description=description)
        else:
            config = tyro.cli(options, description=description)
            check_whole_numbers(config)
            folder = run_folder_of(config)
            with contextlib.nullcontext() if folder is None else alone_in(folder):
                main(config)
        return 0

    _importing.close()
    kept = "what is done stays; long experiments, given the same folder again, go on where they were"
    code = ended_well(run, f"{NAME}: ", kept)
    leave_ends_to_the_system()
    sys.exit(code)


def run_folder_of(config: Any) -> Path | None:
    """The run folder that options name, an `--out` that may be left out; None where they name none, or a picture."""
    may_be_left_out = any(field.name == "out" and field.default is None for field in dataclasses.fields(config))
    return config.out if may_be_left_out and config.out is not None and config.out.suffix not in PICTURES else None


def check_whole_numbers(config: Any) -> None:
    """Refuses negative options, and counts of nothing, before anything is begun.

    Raises:
        InvalidOptionError: names the option.
    """
    from drift_drake.common.errors import InvalidOptionError

    for field in dataclasses.fields(config):
        value, least = getattr(config, field.name), int(field.name in COUNTS)
        if isinstance(value, int) and value < least and not isinstance(value, bool):
            raise InvalidOptionError(f"--{field.name.replace('_', '-')} {value}: give {least} or more")
