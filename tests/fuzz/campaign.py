"""Thousands of spoilt inputs of every kind, each read by the command as a shell runs it, in a process with limits.

    python tests/fuzz/campaign.py --trials 10000

Trials are numbered, and those that are done are in FOLDER/trials.csv: ended and given again, it goes on. An input that
is answered in a way that none was before is kept in FOLDER/corpus, and spoilt further by later trials. A trial that
ended in a traceback, a warning, a crash, a hang (20 s of processor time; 100 s of commands that fit a car, which show
their progress) or more than 2 GB is kept whole in FOLDER/findings.
"""

import argparse
import ast
import contextlib
import csv
import gc
import io
import os
import re
import shutil
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path
from random import Random

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "gap" / "logs"), str(HERE.parents[1])]

from as_command import Ended, command, warm  # noqa: E402
from campaign_cars import LONGEST_FIT  # noqa: E402
from campaign_place import Place  # noqa: E402
from campaign_seeds import make_seeds  # noqa: E402
from campaign_trials import TRIALS  # noqa: E402
from forked_reader import read_by_copies  # noqa: E402
from fuzzing import LONGEST  # noqa: E402
from tqdm import tqdm  # noqa: E402

from drift_drake.cli.main import main as drift_drake  # noqa: E402

LARGEST_KEPT = 100_000  # bytes
HEADER = ["trial", "kind", "command", "code", "seconds", "megabytes", "flaw"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--trials", type=int, default=10_000)
    parser.add_argument("--folder", type=Path, default=HERE.parents[1] / "build" / "fuzz")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", type=int, help="trials to do again; they are not written down")
    parser.add_argument("--findings", action="store_true", help="try the kept findings again, and nothing else")
    given = parser.parse_args()
    folder = given.folder.resolve()
    seeds, table = folder / "seeds", folder / "trials.csv"
    make_seeds(seeds)
    warmed(seeds)
    if given.findings:
        return findings_again(folder)
    done = _done(table)
    numbers = given.only or [number for number in range(given.trials) if number not in done]
    heard = _heard(folder / "corpus")
    with table.open("a", newline="") as stream:
        writer = csv.writer(stream)
        if not done and not given.only:
            writer.writerow(HEADER)
        for number in tqdm(numbers, unit="trial", mininterval=5.0, file=sys.stderr):
            rows = tried(folder, seeds, given.seed, number, heard)
            if not given.only:
                writer.writerows(rows)
                stream.flush()
            for row in rows if given.only else [row for row in rows if row[-1]]:
                tqdm.write(", ".join(str(cell) for cell in row))
    print(summary(table))
    return 0


def warmed(seeds: Path) -> None:
    """Imports and compiles once, in this process, what the trials' processes are copies with."""
    warm()
    read_by_copies()
    with tempfile.TemporaryDirectory() as text, contextlib.chdir(text), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        shutil.copytree(seeds / "log", "case")
        os.rename("case/full.csv", "case/run_0.csv")
        os.rename("case/long.csv", "long.csv")
        os.remove("case/few.csv")
        car, quick = ("--vehicle", str(seeds / "vehicle" / "plain.yaml")), ("--effects", "steering_lag", "--quiet")
        predicted = ("--criterion", "prediction", "--force")
        recording, mapping = seeds / "recording.csv", seeds / "mapping" / "full.yaml"
        for words in (
            ("check", "case", *car, "--workers", "1"),
            ("diagnose", "case", *car, *quick, "--workers", "1", "--json", "a.json"),
            ("watch", "case/run_0.csv", *car),
            ("replay", "case/run_0.csv", *car),
            ("plan-next", "a.json", *car),
            ("simulate", "slalom", *car, "--duration", "1", "--out", "s.csv"),
            ("identify", "case", *car, *quick, "--json", "i.json"),
            ("identify", "long.csv", *car, *quick, *predicted, "--json", "p.json"),
            (
                "identify",
                "long.csv",
                *car,
                *quick,
                *predicted,
                "--car",
                "double-track",
                "--json",
                "d.json",
                "--out",
                "d.yaml",
            ),
            ("diagnose", "long.csv", "--vehicle", "d.yaml", "--calibration", "d.json", *quick, "--workers", "1"),
            ("replay", "case/run_0.csv", "--vehicle", str(seeds / "two_track" / "saloon.yaml")),
            ("import", "--look", str(recording)),
            ("import", "--look", str(seeds / "recordings" / "drive.npz")),
            ("import", str(recording), "--mapping", str(mapping), "--out", "out"),
        ):
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
                code = drift_drake(words)
            if code:
                print(f"{words[0]}: {said.getvalue()}", file=sys.stderr)
        kinds = {
            "a.json": "answer",
            "i.json": "calibration",
            "p.json": "calibration",
            "d.json": "calibration",
            "d.yaml": "two_track",
        }
        for name, kind in kinds.items():
            if Path(name).exists():
                shutil.copy(name, seeds / kind / f"made_{name}")
    gc.collect()
    gc.freeze()  # so that copies do not write into what they share


def tried(folder: Path, seeds: Path, seed: int, number: int, heard: set[str]) -> list[list[object]]:
    """One trial: a row of each of its commands."""
    rng = Random(f"{seed} {number}")
    kinds = list(TRIALS)
    kind = rng.choices(kinds, [TRIALS[kind] for kind in kinds])[0]
    place = Place(folder / "now", seeds, folder / "corpus")
    shutil.rmtree(place.folder, ignore_errors=True)
    place.folder.mkdir()
    rows: list[list[object]] = []
    trial = kind(rng, place)
    with contextlib.suppress(StopIteration):
        words = next(trial)
        while True:
            ended = words if isinstance(words, Ended) else command(place.folder, *words, longest=longest(words[0]))
            said = kind.__name__ if isinstance(words, Ended) else " ".join(str(word) for word in words[:3])[:80]
            rows.append(
                [number, kind.__name__, said, ended.code, f"{ended.seconds:.2f}", ended.memory >> 20, ended.flaw]
            )
            if ended.flaw:
                kept = folder / "findings" / str(number)
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(place.folder, kept, ignore=lambda _, names: [name for name in names if name == "pipe"])
                words = f"{words}\n{ended.flaw}\n{ended.said}"
                (kept / "how.txt").write_text(words, errors="replace")
                break
            _keep(place, ended, heard)
            words = trial.send(ended)
    return rows


def longest(name: object) -> float:
    """[s] of processor time that a command may take."""
    return LONGEST_FIT if name in ("identify", "diagnose", "choose") else LONGEST


def findings_again(folder: Path) -> int:
    """Tries the kept findings again; returns how many still end badly."""
    bad = 0
    for kept in sorted((folder / "findings").glob("*/how.txt")):
        first = kept.read_text(errors="replace").splitlines()[0]
        if not first.startswith("("):  # a plug-in's, in a fresh Python
            continue
        now = folder / "now"
        shutil.rmtree(now, ignore_errors=True)
        shutil.copytree(kept.parent, now)
        words = ast.literal_eval(first)
        ended = command(now, *words, longest=longest(words[0]))
        bad += bool(ended.flaw)
        print(f"{kept.parent.name}: {first[:100]}: {ended.flaw or 'ends well'}", flush=True)
    return bad


def _keep(place: Place, ended: Ended, heard: set[str]) -> None:
    """Keeps what was answered in a new way: other words but names and numbers."""
    last = (ended.said.strip().splitlines() or [""])[-1]
    how = re.sub(r"'[^']*'|\"[^\"]*\"|\S*[\d/]\S*", "", last)[:100]
    for kind, path in place.subjects:
        way = f"{kind} {ended.code} {how}"
        if way in heard or not path.exists() or path.stat().st_size > LARGEST_KEPT:
            continue
        heard.add(way)
        into = place.corpus / kind
        into.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, into / f"{len(heard)}{path.suffix}")
        with (place.corpus.parent / "heard.txt").open("a", errors="replace") as stream:
            stream.write(way + "\n")


def _heard(corpus: Path) -> set[str]:
    path = corpus.parent / "heard.txt"
    return set(path.read_text().split("\n")) if path.exists() else set()


def _done(table: Path) -> set[int]:
    if not table.exists():
        return set()
    with table.open(newline="") as stream:
        return {int(row["trial"]) for row in csv.DictReader(stream)}


def summary(table: Path) -> str:
    """Trials and flaws by kind."""
    with table.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    lines = []
    for kind in sorted({row["kind"] for row in rows}):
        of_kind = [row for row in rows if row["kind"] == kind]
        flaws = Counter(row["flaw"] for row in of_kind if row["flaw"])
        slowest, most = max(float(row["seconds"]) for row in of_kind), max(int(row["megabytes"]) for row in of_kind)
        taken = sum(row["code"] in ("0", "3") for row in of_kind)
        tried = len({row["trial"] for row in of_kind})
        lines.append(
            f"{kind:<14}{tried:>6} trials, {len(of_kind):>6} commands, {taken:>6} taken, slowest {slowest:.1f} s, "
            f"most {most} MB, flaws: {dict(flaws) or 'none'}"
        )
    lines.append(f"{len({row['trial'] for row in rows})} trials, {sum(bool(row['flaw']) for row in rows)} flaws")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
