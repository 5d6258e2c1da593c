"""Long commands ended at random moments, by kill -9, Ctrl-C and SIGTERM, then given again: the same results to the bit.

    python -m experiments.robustness.interruptions --count 80

Each command is first run through undisturbed. Then, in a fresh folder, it is ended at random moments, up to four times,
and given again until it ends by itself; every number that it wrote must be that of the undisturbed run, times and dates
aside. Ctrl-C, which reaches all of a command's processes as at a terminal, and SIGTERM must be answered in one line,
and nothing be said after kill -9. Broken off, it goes on where it was (give --out).
"""

import contextlib
import dataclasses
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.interruption import ENDS
from drift_drake.common.run_folder import is_done, make_run_folder, write_json
from drift_drake.common.safe_files import PARTIAL, write_table
from experiments.made import RunConfig
from experiments.robustness.long_commands import COMMANDS

MOST_OFTEN = 4  # interruptions of one attempt
PATIENCE = 120.0  # [s] beyond which a command that was interrupted hangs
HELPERS = 0.5  # [s] in which a command's processes end after it
OF_TIME = ("second", "_ms_", "late_solves", "date", "made", "spent")  # in names of numbers that no run repeats
NOT_RESULTS = ("versions.json", "summary.json", "config.json", "report.md")


class UndisturbedError(DriftDrakeError, RuntimeError):
    """A command that does not even end well undisturbed; the message says what it said."""


@dataclasses.dataclass(frozen=True)
class InterruptionsConfig(RunConfig):
    """How often, and what."""

    count: int = 80
    """Attempts; each is interrupted up to four times."""
    commands: tuple[str, ...] = tuple(COMMANDS)
    signals: tuple[Literal["SIGINT", "SIGTERM", "SIGKILL"], ...] = ("SIGINT", "SIGTERM", "SIGKILL")
    """Drawn from with equal probability."""
    latest: float = 1.0
    """Moment of an interruption, as a share of the undisturbed run's duration; 0.2: within the imports mostly."""
    seed: int = 0


def results(folder: Path) -> dict[str, str]:
    """A hash of the numbers in each file of results: no times, no dates, no files that a kill left unfinished."""
    found = {}
    for path in sorted(folder.rglob("*")):
        unfinished = any(part.startswith(PARTIAL) for part in path.relative_to(folder).parts)
        if unfinished or path.suffix not in (".json", ".csv", ".parquet", ".npz", ".yaml") or path.name in NOT_RESULTS:
            continue
        found[str(path.relative_to(folder))] = hashlib.sha256(_numbers(path)).hexdigest()
    return found


def _numbers(path: Path) -> bytes:
    if path.suffix == ".yaml":
        return path.read_bytes()
    if path.suffix == ".json":
        return json.dumps(_timeless(json.loads(path.read_text())), sort_keys=True).encode()
    if path.suffix in (".csv", ".parquet"):
        table = pd.read_csv(path) if path.suffix == ".csv" else pd.read_parquet(path)
        return table[[name for name in table if not _of_time(str(name))]].to_csv(index=False).encode()
    with np.load(path, allow_pickle=False) as stored:
        parts = {name: stored[name] for name in stored.files}
    said = {
        name: json.dumps(_timeless(json.loads(str(value)))) for name, value in parts.items() if value.dtype.kind == "U"
    }
    return b"".join(
        name.encode() + (said[name].encode() if name in said else value.tobytes())
        for name, value in sorted(parts.items())
    )


def _timeless(data: Any) -> Any:
    if isinstance(data, dict):
        return {name: _timeless(value) for name, value in data.items() if not _of_time(name)}
    return [_timeless(value) for value in data] if isinstance(data, list) else data


def _of_time(name: str) -> bool:
    return any(part in name for part in OF_TIME)


@contextlib.contextmanager
def begun(arguments: list[str], log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Python in a session of its own, as at a terminal of its own; standard error goes to a file."""
    with log.open("wb") as file, log.with_suffix(".out").open("wb") as out:
        process = subprocess.Popen([sys.executable, *arguments], stdout=out, stderr=file, start_new_session=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def interrupted(arguments: list[str], number: signal.Signals, moment: float, log: Path) -> dict[str, Any]:
    """Ends a command `moment` [s] after its start: what it said from then on, and whether it had ended before."""
    start, before = time.monotonic(), 0
    with begun(arguments, log) as process:
        try:
            process.wait(moment)
        except subprocess.TimeoutExpired:
            before = log.stat().st_size
            (os.killpg if number == signal.SIGINT else os.kill)(process.pid, number)
        try:
            code = process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            return {"hangs": True, "said": "", "code": None, "seconds": PATIENCE}
    seconds = time.monotonic() - start
    time.sleep(HELPERS)
    return {"hangs": False, "said": last_lines(log, before), "code": code, "seconds": seconds}


def answered(end: dict[str, Any], number: signal.Signals) -> bool:
    """Whether a signal was answered in one line: the program's, unless it had not begun or had ended."""
    lines = end["said"].splitlines()
    if number not in ENDS:
        return not lines
    how = ENDS[number][0]
    begun_already = any(word in end["said"] for word in ("drift_drake/", "experiments/", "diagrams/", how))
    return end["code"] == 0 or not begun_already or (len(lines) == 1 and how in lines[0])


def last_lines(log: Path, start: int = 0) -> str:
    """What a command said on standard error from a byte on, its progress bars left out."""
    lines = log.read_bytes()[start:].decode(errors="replace").replace("\r", "\n").splitlines()
    return "\n".join(line for line in lines if line.strip() and "%|" not in line and "it/s" not in line)


def attempt(name: str, inputs: Path, folder: Path, wanted: dict[str, str], duration: float, names: Sequence[str],
            generator: np.random.Generator) -> dict[str, Any]:  # fmt: skip
    """One command in a fresh folder, ended a few times and then given again."""
    folder.mkdir(parents=True)
    out = folder / "out"
    out.mkdir()
    COMMANDS[name].begin(inputs, out)
    arguments = COMMANDS[name].arguments(inputs, out)
    ends = []
    for k in range(int(generator.integers(1, MOST_OFTEN + 1))):
        number = signal.Signals[str(generator.choice(names))]
        moment = float(generator.uniform(0.0, duration))
        # A file each: what a killed command's helpers still say is not of the next one.
        end = interrupted(arguments, number, moment, folder / f"end_{k}.log")
        ends.append({"signal": number.name, "moment": moment, "one_line": answered(end, number)} | end)
        if end["code"] == 0:
            break
    log = folder / "resumed.log"
    with begun(arguments, log) as process:
        code = process.wait()
    same, left = results(out) == wanted, len(list(out.rglob(f"{PARTIAL}*")))
    said = "" if code == 0 else last_lines(log)
    return {"command": name, "ends": ends, "code": code, "same": same, "left": left, "said": said}


def main(config: InterruptionsConfig) -> None:
    """Makes the interruptions that are missing and reports the outcome."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in a shell's background job; commands would inherit it
        signal.signal(signal.SIGINT, signal.default_int_handler)
    folder = make_run_folder("interruptions", config.out)
    undisturbed = {name: _undisturbed(name, folder) for name in config.commands}
    found = []
    for index in tqdm(range(config.count), unit="interruption"):
        path = folder / f"attempt_{index:03d}.json"
        if not is_done(path):
            name = config.commands[index % len(config.commands)]
            generator = np.random.default_rng([config.seed, index])
            trial = folder / "attempts" / f"{index:03d}_{os.getpid()}"
            wanted, duration = undisturbed[name]
            moments = config.latest * duration
            made = attempt(name, folder / name / "inputs", trial, wanted, moments, config.signals, generator)
            # Where a command had ended before it was to be interrupted, the next moments are drawn earlier.
            shorter = min([duration, *(end["seconds"] for end in made["ends"] if end["code"] == 0)])
            undisturbed[name] = wanted, shorter
            write_json(path, made)
        found.append(json.loads(path.read_text()))
    ends = [end for one in found for end in one["ends"] if end["code"] != 0]
    write_table(pd.DataFrame([{"command": one["command"], "same": one["same"]} for one in found]),
                folder / "attempts.csv", index=False)  # fmt: skip
    print(f"{len(ends)} interruptions of {len(found)} commands ({', '.join(config.commands)}): "
          f"{sum(not one['same'] for one in found)} with other results, {sum(one['code'] != 0 for one in found)} that "
          f"could not go on, {sum(end['hangs'] for end in ends)} hangs, "
          f"{sum(not end['one_line'] for end in ends)} not answered in one line, "
          f"{sum(one['left'] > 0 for one in found)} that left an unfinished file\nresults in {folder}")  # fmt: skip


def _undisturbed(name: str, folder: Path) -> tuple[dict[str, str], float]:
    """Hashes of what a command writes, and how long it takes [s]; its inputs are made first."""
    done = folder / name / "undisturbed.json"
    if not is_done(done):
        inputs, out = folder / name / "inputs", folder / name / "out"
        if not (folder / name / "inputs_are_made").exists():
            inputs.mkdir(parents=True)
            COMMANDS[name].prepare(inputs)
            (folder / name / "inputs_are_made").touch()
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()
        COMMANDS[name].begin(inputs, out)
        start = time.monotonic()
        with begun(COMMANDS[name].arguments(inputs, out), folder / name / "log.txt") as process:
            code = process.wait()
        if code != 0:
            raise UndisturbedError(f"{name}: {last_lines(folder / name / 'log.txt')}")
        write_json(done, {"results": results(out), "time": time.monotonic() - start})
    known = json.loads(done.read_text())
    return known["results"], known["time"]


if __name__ == "__main__":
    run_command(main, InterruptionsConfig)
