"""`drift-drake import`: recordings to a case folder of runs, with a report."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import alone_in, try_outputs, write_table, writing_together
from drift_drake.common.standard_output import command_line, said_to, write_results, write_text

MOST_NAMED = 4  # runs that a remark names

if TYPE_CHECKING:
    from drift_drake.gap.logs.importing.importer import ImportReport
    from drift_drake.gap.logs.importing.mapping import RecorderMapping


@dataclasses.dataclass(frozen=True)
class Import:
    """Turn a recorder's files into runs of the log format, and say what looks wrong in them.

    drift-drake import --look lap.mcap > mine.yaml

    drift-drake import lap.mcap --mapping mine.yaml --out logs/monday

    A mapping file says of each quantity its column, unit, sign, frame (iso8855, ned, sae) and clock; the
    presets are such files. The smallest one:

    clocks: {logger: {column: time}}

    signals: {r: {column: gyro_z, unit: deg/s, frame: ned}, v: {column: speed, unit: km/h}, delta_cmd: {column:
    road_wheel, unit: deg}}

    Writes OUT/run_0.csv, OUT/run_1.csv, ... (a case for `drift-drake diagnose`) and OUT/import.json: which run is which
    stretch of which recording, the clocks' offsets, the noise, and the remarks. Of positions (latitude, longitude)
    without a yaw rate or a steering command it writes the paths, OUT/path_0.csv, ..., and says what they show.
    """

    recordings: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="RECORDINGS")]
    """Files of one vehicle on one day: CSV, Parquet, MCAP, ROS bags, MDF, MATLAB .mat, .npz, HDF5, VBOX .vbo, AiM .xrk,
    PX4 .ulg, CAN frames."""
    mapping: str = ""
    """Mapping file (YAML: columns, units, frames, clocks), or a preset: dart, dart_sensors, revs_250lm."""
    out: Path | None = None
    """Folder for the runs; it may not hold any yet."""
    look: bool = False
    """Only say what the first file holds, topics, rates and units, and print a mapping to begin with."""
    dbc: tuple[Path, ...] = ()
    """Databases of CAN messages (DBC), by which raw frames (candump, .asc, .blf, .trc, MDF) are decoded."""
    start: float = 0.0
    """Leave out what lies before, in seconds after each recording's first reading."""
    end: float = math.inf
    """Leave out what lies after."""
    trust: tuple[str, ...] = ()
    """Columns of the log to take as they are, however large: r of a car that does turn that fast."""
    report: Path | None = None
    """Where to write an HTML report: signals, and what columns say of each other."""
    json: Path | None = None
    """Where to write the report, with --look what the file holds, as JSON (-: standard output); the report is in
    OUT/import.json too."""


def run_import(command: Import) -> None:
    for path in command.recordings:
        if not path.exists():
            raise InvalidOptionError(f"{path}: no such file; 'drift-drake import --help' says which formats are read")
    if command.look:
        with ended_at_once():
            from drift_drake.gap.logs.importing.look import look, mapping_text

        try_outputs({"--json": command.json}, command.recordings)
        found = look(command.recordings[0], command.dbc)
        print(mapping_text(found), end="", file=said_to(command.json))
        write_results(command.json, found)
        return
    if not command.mapping or command.out is None:
        raise InvalidOptionError(
            "--mapping and --out are needed to import; 'drift-drake import --look FILE' prints a first mapping"
        )
    with ended_at_once():
        from drift_drake.car.log.table import IMPORT_REPORT
        from drift_drake.gap.logs.importing.known import is_path_only
        from drift_drake.gap.logs.importing.mapping import read_mapping

    mapping = read_mapping(command.mapping)
    try_outputs({"--json": command.json, "--report": command.report}, [command.mapping, *command.recordings])
    with ended_at_once():
        from drift_drake.gap.logs.importing.import_logs import check_asked, import_logs

    if is_path_only(mapping):
        if command.report is not None:
            raise InvalidOptionError("--report is of a log; of positions alone there is none")
        with alone_in(command.out):
            check_asked(command.out, command.start, command.end, command.trust)
            _import_paths(command, mapping, command.out)
        return

    imported = import_logs(
        command.recordings, command.mapping, command.out, start=command.start, end=command.end, trust=command.trust,
        dbc=command.dbc,
    )  # fmt: skip
    print(summary(imported.report), file=said_to(command.json))
    if command.json is not None:
        write_text(command.json, (command.out / IMPORT_REPORT).read_text(encoding="utf-8"))
    if command.report is not None:
        from drift_drake.gap.logs.importing.import_report import report_html
        from drift_drake.view.pages.page import Source

        source = Source(command_line("import", command, "recordings"), command.out)
        write_text(command.report, report_html(imported, command.out.name, source))


def _import_paths(command: Import, mapping: "RecorderMapping", out: Path) -> None:
    """Writes the paths of recordings that hold positions and too little else for a log."""
    with ended_at_once():
        from drift_drake.car.log.table import IMPORT_REPORT
        from drift_drake.common.run_folder import write_json
        from drift_drake.gap.logs.importing.paths import import_paths, path_sentences

    paths, remarks = import_paths(command.recordings, mapping, command.start, command.end, command.dbc)
    lines = path_sentences(paths, mapping)
    with writing_together(out) as part:
        for number, path in enumerate(paths):
            write_table(path.table, part / f"path_{number}.csv", index=False)
        report = {"paths": [path.recording for path in paths], "sentences": lines, "remarks": remarks}
        write_json(part / IMPORT_REPORT, report | {"mapping": dataclasses.asdict(mapping)})
    print("\n".join([*lines, *(f"! {remark}" for remark in remarks)]), file=said_to(command.json))
    if command.json is not None:
        write_text(command.json, (out / IMPORT_REPORT).read_text(encoding="utf-8"))


def summary(report: "ImportReport") -> str:
    lines = []
    for number, run in enumerate(report.runs):
        noise = ", ".join(f"{name} {value:.2g}" for name, value in run.std.items() if name in ("r", "v", "beta"))
        lines.append(
            f"run_{number}: {run.recording}, {run.start:.2f} to {run.end:.2f} s, {run.rows} rows; noise (SI): {noise}"
        )
    for recording, clocks in report.clocks.items():
        for name, clock in clocks.items():
            if clock.std is None:
                lines.append(f"clock {name} of {recording}: as the rows or the mapping have it, not estimated")
                continue
            lines.append(
                f"clock {name} of {recording}: its readings arrive {clock.arrival:.3f} s late "
                f"(+- {clock.std:.3f} s, correlation {clock.correlation:.3f}); corrected"
            )
    where: dict[str, list[str]] = {}
    for remark in report.remarks:
        name, sentence = remark.split(": ", 1)
        where.setdefault(sentence, []).append(name)
    lines += [f"! {sentence} ({_names(names)})" for sentence, names in where.items()]
    blind = [*_whether(report.unchecked), *report.undecided]
    if not blind:
        return "\n".join(lines if where else [*lines, "Signs and units: nothing looks wrong."])
    said = f"no other column tells {', '.join(blind)}"
    return "\n".join([*lines, f"Signs and units: {'' if where else 'nothing else looks wrong; '}{said}."])


def _whether(names: Sequence[str]) -> list[str]:
    return [f"whether {', '.join(names)} {'is' if len(names) == 1 else 'are'} right"] if names else []


def _names(names: list[str]) -> str:
    """Of runs, at most a few."""
    few = ", ".join(names[:MOST_NAMED])
    return few if len(names) <= MOST_NAMED else f"{few} and {len(names) - MOST_NAMED} more"
