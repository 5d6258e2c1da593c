"""`drift-drake demo`: the commands that a user would give, one after the other, on the sample log."""

import contextlib
import dataclasses
import shlex
import shutil
from importlib.resources import as_file, files
from pathlib import Path

import tyro

from drift_drake.car.parameters import WORDS, Tolerance, VehicleParameters
from drift_drake.common.errors import DriftDrakeError, OutputError
from drift_drake.common.safe_files import try_folder, try_outputs, write_text
from drift_drake.common.standard_output import said_to, write_results

SAMPLE_LOG = files("drift_drake") / "data" / "sample_log"
PAGES = {"report": "report.html", "replay": "replay.html", "drive": "drive/replay.html"}
HEAD = """\
# What a simulator believes of a car: a single track with brush tyres, SI units, ISO 8855.
# The numbers are those of a plausible coupe: replace them by those of your car. `drift-drake identify` estimates from
# logs of a day of driving what cannot be measured with scales or a tape measure.
"""
COMMENTS = {
    "mass": "with driver and fuel, as on the scales",
    "yaw_inertia": "mass * front_axle_distance * rear_axle_distance is a first guess",
    "front_axle_distance": "centre of gravity to front axle: rear share of the weight times the wheelbase",
    "rear_axle_distance": "centre of gravity to rear axle",
    "wheel_radius": "loaded, rolling: distance rolled in one turn over 2 pi",
    "rear_axle_inertia": "both rear wheels, shafts and what the engine adds through the gears",
    "gear_ratio": "axle torque over engine torque, in the gear that is driven",
    "friction": "of tyre and road",
    "front_stiffness": "slope of an axle's force over slip at small slip; 8 to 15 times its load",
    "rear_stiffness": "likewise",
    "gravity": "where it drives",
    "front_coupling": "0: rear-wheel drive; 1: one shaft for both axles",
    "steering_limit": "of the road wheels",
    "torque_min": "of the engine: its braking",
    "torque_max": "of the engine",
}
TOLERANCES = """\
# One standard deviation of what is known of each number above: relative, but for the axle's distance [m] and the
# steering offset [rad]. A deviation of this size is no gap; `drift-drake diagnose` takes it for granted.
tolerance:
"""
TAIL = """\
# Effects that the car has in addition, as `drift-drake apply` adds them; `drift-drake effects` lists them.
# effects:
#   steering_lag: 0.08
"""


class DemoError(DriftDrakeError, RuntimeError):
    """A command of the demo failed; it has said why."""


@dataclasses.dataclass(frozen=True)
class Demo:
    """Diagnose the sample log, correct its simulator, and drift a car: some minutes, one folder.

    drift-drake demo

    Four simulated runs of a car with an effect that its vehicle file lacks are diagnosed, the corrected vehicle is
    replayed with them, and the car drifts a figure-8 under a model that learns as it drives. Each command is shown
    before it runs, to be given again with logs and a vehicle file of your own.
    """

    out: tyro.conf.Positional[Path] = Path("drift-drake-demo")
    """Folder for all that is written; there may be none yet."""
    json: Path | None = None
    """Where to write which commands were run and which pages they made, as JSON (-: standard output)."""


def run_demo(command: Demo) -> None:
    """`drift-drake demo`.

    Raises:
        OutputError: the folder is there already, or cannot be made.
        DemoError: one of its commands failed.
    """
    from drift_drake.cli.main import main

    if command.out.exists():
        raise OutputError(f"{command.out}: is there already; give the demo a new folder")
    try_outputs({"--json": command.json})
    try_folder(command.out, "OUT")
    with as_file(SAMPLE_LOG) as log:
        shutil.copytree(log, command.out / "sample", ignore=shutil.ignore_patterns("truth.json"))
    given = commands(command.out)
    with contextlib.redirect_stdout(said_to(command.json)):
        for words in given:
            print(f"\n$ drift-drake {shlex.join(words)}", flush=True)
            if main(words) != 0:
                raise DemoError(f"the demo ended at 'drift-drake {words[0]}'; what it has written is in {command.out}")
        pages = {name: command.out / page for name, page in PAGES.items()}
        print(f"\nOpen {pages['report']} (the diagnosis), {pages['replay']} (the log and both simulators) and "
              f"{pages['drive']} (the drift).")  # fmt: skip
    write_results(command.json, {"out": command.out, "commands": given, "pages": pages})


def commands(folder: Path) -> list[list[str]]:
    """What the demo runs, as words of a command line."""
    car, corrected, answer = (str(folder / name) for name in ("car.yaml", "corrected.yaml", "answer.json"))
    sample, report, replay = (str(folder / name) for name in ("sample", "report.html", "replay.html"))
    log = str(folder / "sample" / "run_0.csv.gz")
    return [
        ["init", car],
        ["diagnose", sample, "--vehicle", car, "--json", answer, "--report", report],
        ["apply", answer, "--vehicle", car, "--out", corrected],
        ["replay", log, "--vehicle", car, "--corrected", corrected, "--html", replay],
        ["drive", "figure_8", "--vehicle", corrected, "--model", "online", "--out", str(folder / "drive")],
    ]


@dataclasses.dataclass(frozen=True)
class Init:
    """Write a vehicle file to begin with: every parameter with its unit and how to come by it.

    drift-drake init car.yaml
    """

    out: tyro.conf.Positional[Path]
    """The vehicle file to write (YAML); there may be none yet."""
    json: Path | None = None
    """Where to write its name and parameters as JSON (-: standard output)."""


def run_init(command: Init) -> None:
    """`drift-drake init`; raises OutputError where the file is there already, or cannot be written."""
    if command.out.exists():
        raise OutputError(f"{command.out}: is there already; give another name")
    try_outputs({"OUT": command.out, "--json": command.json})
    write_text(command.out, starter_vehicle())
    print(f"{command.out}: a coupe, one parameter a line; replace them by your car's, then: drift-drake drive figure_8 "
          f"--vehicle {command.out}", file=said_to(command.json))  # fmt: skip
    write_results(command.json, {"out": command.out, "vehicle": VehicleParameters()})


def starter_vehicle() -> str:
    """The text of the file."""
    vehicle, lines = VehicleParameters(), []
    for field in dataclasses.fields(vehicle):
        if field.name not in WORDS:
            note = f"[{field.metadata['unit']}] {COMMENTS.get(field.name, '')}".rstrip()
            lines.append(f"{f'{field.name}: {getattr(vehicle, field.name):g}':<28}# {note}")
    tolerances = [f"  {field.name}: {getattr(Tolerance(), field.name):g}" for field in dataclasses.fields(Tolerance)]
    return HEAD + "\n".join(lines) + "\n" + TOLERANCES + "\n".join(tolerances) + "\n" + TAIL
