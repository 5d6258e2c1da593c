"""`drift-drake identify` and `drift-drake diagnose` as jobs whose files are kept: what is there is not done again.

The commands' own functions run, with their own defaults, so that an experiment shows what an engineer would get.
"""

import contextlib
import dataclasses
import io
import json
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from drift_drake.cli.diagnose import Diagnose, run_diagnose
from drift_drake.cli.identify import Identify, run_identify
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.executors import ExecutorConfig, run_jobs
from drift_drake.common.run_folder import write_json
from drift_drake.gap.identification.options import Criterion

REFUSED, CRASHED, NO_CAR = "refused", "crashed", "no car"
"""Verdicts of cases without an answer: the logs cannot be used; a defect; the calibration failed."""


@dataclasses.dataclass(frozen=True)
class Calibrate:
    """A car to calibrate: `folder` gets car.yaml, car.json and car.txt (what the command says)."""

    logs: tuple[Path, ...]  # a folder a day
    start: Path  # first guess
    folder: Path
    criterion: Criterion = "auto"

    @property
    def out(self) -> Path:
        return self.folder / "car.json"


@dataclasses.dataclass(frozen=True)
class Ask:
    """A case to diagnose with a calibrated car."""

    case: Path
    car: Path  # folder of `Calibrate`
    out: Path  # JSON


def calibrate(job: Calibrate) -> None:
    """Calibrates; the car is written also where it predicts worse than the first guess, which its scores show."""

    def work(out: Path) -> None:
        output = io.StringIO()
        with contextlib.redirect_stdout(output):
            run_identify(Identify(job.logs, job.start, job.folder / "car.yaml", out, criterion=job.criterion,
                                  force=True, quiet=True))  # fmt: skip
        (job.folder / "car.txt").write_text(output.getvalue().replace(str(out), str(job.out)))

    recorded(work, job.out)


def ask(job: Ask) -> None:
    """Diagnoses; where the car could not be calibrated, that is what is recorded."""
    car = job.car / "car.json"
    if not car.exists():
        write_json(failure_path(job.out), {"verdict": NO_CAR, "message": f"{car} is missing"})
        return

    def work(out: Path) -> None:
        with contextlib.redirect_stdout(None):
            run_diagnose(Diagnose(job.case, job.car / "car.yaml", out, calibration=car, workers=1, quiet=True))

    recorded(work, job.out)


def failure_path(out: Path) -> Path:
    """Where it is written why there is no answer."""
    return out.with_suffix(".failed.json")


def recorded(work: Callable[[Path], None], out: Path) -> None:
    """Has `work` write a JSON file, adds the seconds of CPU, and puts it in its place; a failure goes next to it."""
    out.parent.mkdir(parents=True, exist_ok=True)
    failed, part = failure_path(out), out.with_suffix(".part.json")
    failed.unlink(missing_ok=True)
    began = time.process_time()
    try:
        work(part)
    except DriftDrakeError as error:
        write_json(failed, {"verdict": REFUSED, "message": str(error)})
        return
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        write_json(failed, {"verdict": CRASHED, "message": what, "traceback": traceback.format_exc()})
        return
    data = json.loads(part.read_text()) | {"cpu_seconds": time.process_time() - began}
    write_json(part, data)
    part.replace(out)


def done_once(workers: int, function: Callable[[Any], None], jobs: Sequence[Calibrate | Ask], unit: str) -> None:
    """Runs the jobs whose file is not there, in processes, with a progress bar."""
    left = [job for job in jobs if not job.out.exists()]
    if left:
        print(f"{len(jobs) - len(left)} of {len(jobs)} {unit}s are there already", flush=True)
    run_jobs(ExecutorConfig(workers=workers), function, left, lambda _job, _result: None, unit)


def answer_of(out: Path) -> dict[str, Any]:
    """The answer, or the failure as an answer that names nothing."""
    if out.exists():
        answer: dict[str, Any] = json.loads(out.read_text())
        return answer
    failed: dict[str, Any] = json.loads(failure_path(out).read_text())
    return {"causes": [], "posterior": {}, "ambiguity": [], "magnitudes": {}, "details": {}, "warnings": []} | failed
