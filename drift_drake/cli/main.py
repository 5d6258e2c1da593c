"""The command line `drift-drake`: which command is in which module, and how bad input and signals end.

The command `plan-next` is the dataclass `PlanNext` and the function `run_plan_next` of its module. A module is imported
when its command is given, and imports in turn what is slow to import once its options are seen to be usable.
"""

import difflib
import io
import resource
import sys
import textwrap
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.metadata import version
from typing import Any, NamedTuple

from drift_drake.common.errors import InvalidOptionError, shown
from drift_drake.common.first_use import said_once
from drift_drake.common.interruption import BAD_INPUT, ended_at_once, ended_well


class Command(NamedTuple):
    """Where a command is, and what the list of commands says of it."""

    module: str
    summary: str
    options: str = ""  # the dataclass's name, where it is not the command's


COMMANDS = {
    "demo": Command("drift_drake.cli.demo", "a tour on a sample log: diagnosis, corrected car, drift"),
    "app": Command("drift_drake.cli.app", "the workbench: all steps in a browser, for one folder"),
    "init": Command("drift_drake.cli.demo", "a commented vehicle file to begin with"),
    "import": Command("drift_drake.cli.import_logs", "recordings of any format to logs, with what looks wrong"),
    "check": Command("drift_drake.cli.check", "quality and coverage of logs, and which effects they could show"),
    "diagnose": Command("drift_drake.cli.diagnose", "where a simulator is wrong, and the effect that it misses"),
    "identify": Command("drift_drake.cli.identify", "a vehicle file calibrated on logs"),
    "plan-next": Command("drift_drake.cli.plan_next", "the drive that distinguishes rival hypotheses best"),
    "apply": Command("drift_drake.cli.apply", "the vehicle file corrected by an answer"),
    "choose": Command("drift_drake.cli.choose", "which model may drive a car at its limits, from its logs"),
    "drive": Command("drift_drake.cli.drive", "a drift under model predictive control", "ClosedLoopDrive"),
    "simulate": Command("drift_drake.cli.simulate", "a simulated car's log of a manoeuvre, or of a log's commands"),
    "replay": Command("drift_drake.cli.replay", "a log compared with the simulators' response to its commands"),
    "watch": Command("drift_drake.cli.watch", "a drive monitored row by row: which change, and since when"),
    "fleet": Command("drift_drake.cli.fleet", "many cars and days: the gap of all, of one car, of one day"),
    "simulator": Command(
        "drift_drake.cli.simulator", "your own simulator, checked before its calibration", "CheckSimulator"
    ),
    "effects": Command("drift_drake.cli.effects", "the effects that can be named, and what shows them", "ListEffects"),
    "export": Command("drift_drake.cli.export", "logs for Foxglove, vehicle files for CommonRoad and MuJoCo"),
    "train": Command("drift_drake.cli.train", "the Bayesian vehicle model, meta-trained"),
}

LEAST_MEMORY = 1 << 30  # bytes of address space that the libraries take before anything is read


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of `drift-drake`; bad input ends with one sentence and exit code 2."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names in a file may hold what no encoding has
    return ended_well(lambda: _run(words), "drift-drake: ", "files are as they were before, or complete")


def _run(words: list[str]) -> int:
    if not words:
        print(usage(), file=sys.stderr)
        return BAD_INPUT
    if words[0] in ("-h", "--help"):
        print(usage())
    elif words[0] == "--version":
        print(f"drift-drake {version('drift_drake')}")
    else:
        name, *rest = words
        check_memory()
        with ended_at_once():
            import tyro

            options, run = load(name)
        given: Any = tyro.cli(options, prog=f"drift-drake {name}", args=rest)
        with said_once():
            return run(given) or 0
    return 0


def check_memory() -> None:
    """Raises InvalidOptionError where the process may not have what the numerical libraries take: they try for ever."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < LEAST_MEMORY:
        raise InvalidOptionError(
            f"{limit >> 20} MB of address space (ulimit -v) are too few for the numerical libraries; allow "
            f"{LEAST_MEMORY >> 20} MB or more"
        )


def load(name: str) -> tuple[type, Callable[[Any], int | None]]:
    """A command's dataclass of options, and what runs it; raises InvalidOptionError where there is no such command."""
    if name not in COMMANDS:
        near = difflib.get_close_matches(name, COMMANDS, 1)
        remedy = f"is it {near[0]}?" if near else f"there are {', '.join(COMMANDS)}"
        raise InvalidOptionError(f"{shown(name)} is not a command; {remedy}")
    module = import_module(COMMANDS[name].module)
    parts = name.split("-")
    options = COMMANDS[name].options or "".join(map(str.capitalize, parts))
    return getattr(module, options), getattr(module, "_".join(["run", *parts]))


def usage() -> str:
    """What `drift-drake --help` says."""
    about = "From a car's logs to what is missing from its simulator, and to the corrected car."
    more = "drift-drake COMMAND --help says what a command does and shows an example. Bad input ends with one sentence "
    more += "and exit code 2; 'diagnose --exit-code' ends with 3 where there is a gap."
    lines = [f"  {name:<11}{command.summary}" for name, command in COMMANDS.items()]
    return "\n".join([
        "usage: drift-drake [--help] [--version] COMMAND ...", "", about, "", *lines, "", *textwrap.wrap(more, 80),
    ])  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
