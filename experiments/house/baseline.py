"""What a redesign must keep, frozen into a folder and compared with it later.

    python -m experiments.house.baseline freeze runs/house-2026-11
    python -m experiments.house.baseline compare runs/house-2026-11
    python -m experiments.house.baseline compare runs/house-2026-11 --kinds own counts

Kinds: `shared`, answers to the cases of ../shared (left out where there are none); `own`, answers to 14 cases made from
the package's own equations; `drives`, metrics of 24 vehicles that drift the figure-8, the controller learning; `plans`,
times of plans in one run; `counts`, the structure (`experiments.house.counts`). Logs and drives are kept as hashes of
their bytes too: a replay is the same to the bit, or it is named. Broken off, either goes on where it was; `compare`
begins anew where a source has changed. It ends with exit code 1 where anything but a time differs.
"""

import dataclasses
import hashlib
import json
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
import tyro
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.run_folder import is_done, plain, write_json, write_versions
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.diagnose import answer_folder
from drift_drake.gap.diagnosis.likelihood.diagnose import diagnose
from drift_drake.view.exporting.logs import columns_of
from experiments.benchmarks.compiled_cases import make_case
from experiments.drifting import benchmark_mpc
from experiments.drifting.runs import Believing, DriveJob, ModelsConfig, drive
from experiments.gap.blind import case_truth, tier_list
from experiments.house.counts import counts
from experiments.structure import ROOT, Tree

Kind = Literal["shared", "own", "drives", "plans", "counts"]
KINDS: tuple[Kind, ...] = ("counts", "own", "shared", "drives", "plans")
SHARED = ROOT.parent / "shared"
OWN_CASES, OWN_SEED = 14, 4747
VEHICLES = 24
PLANS = benchmark_mpc.BenchmarkConfig(horizons=(10, 25, 45), problems=300, referee_problems=0, warm_problems=2)
OF_THE_MACHINE = ("seconds", "provenance", "ms", "plan_over_floor", "controller_over_plan", "worst_over_median",
                  "controller_over_plan_of_one_iteration", "machine", "relative_to_snopt", "solve_ms_median",
                  "solve_ms_99", "late_solves")  # fmt: skip
"""Keys of results that are times, or come from the place of the files."""


@dataclasses.dataclass(frozen=True)
class _Baseline:
    folder: Annotated[Path, tyro.conf.Positional]
    """Of the frozen results."""
    kinds: tuple[Kind, ...] = KINDS
    """What is frozen or compared."""


@dataclasses.dataclass(frozen=True)
class Freeze(_Baseline):
    """Make the results that the folder lacks."""


@dataclasses.dataclass(frozen=True)
class Compare(_Baseline):
    """Make them again, and say what differs."""


Command = Annotated[Freeze, tyro.conf.subcommand("freeze")] | Annotated[Compare, tyro.conf.subcommand("compare")]
Item = tuple[str, Callable[[], dict[str, Any]]]


def items(kinds: tuple[Kind, ...]) -> Iterator[Item]:
    """Names of results and how each is made, those of `kinds`."""
    if "counts" in kinds:
        yield "counts", lambda: dict(counts(Tree(ROOT), "cli/diagnose"))
    if "own" in kinds:
        for i, tier in enumerate(tier_list(OWN_CASES)):
            yield f"own_{i:02d}_{tier}", partial(own_case, i, tier)
    if "shared" in kinds and (SHARED / "cases").is_dir():
        for folder in sorted((SHARED / "cases").iterdir()):
            yield f"shared_{folder.name}", partial(shared_case, folder)
    if "drives" in kinds:
        for vehicle in range(VEHICLES):
            yield f"drive_{vehicle:02d}", partial(drift, vehicle)
    if "plans" in kinds:
        yield "plans", lambda: benchmark_mpc.run(PLANS)["horizons"]


def own_case(index: int, tier: str) -> dict[str, Any]:
    """The answer to a case of the package's own equations, and the bytes of its logs."""
    vehicle, rng = VehicleParameters(), np.random.default_rng([OWN_SEED, index])
    truth, without = case_truth(tier, rng, vehicle)
    runs = make_case(truth, vehicle, rng)
    catalogue = [name for name in CATALOGUE if name not in without]
    found = diagnose(runs, vehicle, case=f"own_{index:02d}", workers=1, catalogue=catalogue).answer
    return answered(found) | {"truth": plain(truth), "logs": [digest(pd.DataFrame(columns_of(run))) for run in runs]}


def shared_case(folder: Path) -> dict[str, Any]:
    """The answer to a shared case."""
    vehicle = VehicleParameters.from_yaml(SHARED / "spec" / "vehicle.yaml")
    return answered(answer_folder(folder, vehicle, workers=1).answer)


def drift(vehicle: int) -> dict[str, Any]:
    """Metrics of a drift of the figure-8 by a held-out vehicle, the model learning as it drives, and its bytes."""
    config = ModelsConfig(vehicles=VEHICLES, noise_seeds=1)
    labels, believes = Believing(load_model(), config.path_step, None)("online", None)
    job = DriveJob(f"drive_{vehicle:02d}", labels, "figure_8", config.effects(vehicle), 0, believes, config.control)
    metrics, table = drive(job)
    own_times = [name for name in table if name == "solve_seconds"]
    return metrics | {"replay": digest(table.drop(columns=own_times)), "rows": len(table)}


def answered(answer: Answer) -> dict[str, Any]:
    """An answer as plain data."""
    return dict(json.loads(answer.to_json()))


def digest(table: pd.DataFrame) -> str:
    """SHA-256 of a table's columns and bytes."""
    numbers = np.ascontiguousarray(table.to_numpy(dtype=float))
    return hashlib.sha256(",".join(map(str, table.columns)).encode() + numbers.tobytes()).hexdigest()


def sources() -> str:
    """SHA-256 of all that the results are made by."""
    found = hashlib.sha256()
    for folder in ("drift_drake", "experiments"):
        for file in sorted((ROOT / folder).rglob("*")):
            if file.suffix in (".py", ".yaml", ".npz", ".json") and "__pycache__" not in file.parts:
                found.update(file.read_bytes())
    return found.hexdigest()[:16]


@one_blas_thread()
def make(folder: Path, kinds: tuple[Kind, ...]) -> None:
    """Writes the results that a folder lacks."""
    missing = [(name, result) for name, result in items(kinds) if not is_done(folder / f"{name}.json")]
    for name, result in tqdm(missing, unit="result"):
        began = time.process_time()
        found = plain(result())
        write_json(folder / f"{name}.json", found | {"seconds": time.process_time() - began})


def differences(before: Any, now: Any, place: str = "") -> Iterator[str]:
    """Where two results differ, times apart: a line each."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in [*before, *(key for key in now if key not in before)]:
            if key not in OF_THE_MACHINE:
                yield from differences(before.get(key), now.get(key), f"{place}.{key}" if place else key)
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for i, (one, other) in enumerate(zip(before, now, strict=True)):
            yield from differences(one, other, f"{place}[{i}]")
    elif before != now:
        yield f"{place}: {before} -> {now}"


def times(before: Any, now: Any) -> dict[str, tuple[float, float]]:
    """CPU times of a result, and of plans by horizon, before and now."""
    found = {"seconds": (before["seconds"], now["seconds"])}
    for horizon, parts in before.items():
        if isinstance(parts, dict) and "ms" in parts and horizon in now:
            for part, values in parts["ms"].items():
                found[f"N = {horizon}, {part} [ms]"] = (values["median"], now[horizon]["ms"][part]["median"])
    return found


def compare(command: Compare) -> None:
    """Makes results anew and prints what differs from the frozen ones.

    Raises:
        DriftDrakeError: nothing is frozen there.
    """
    frozen = [name for name, _ in items(command.kinds) if is_done(command.folder / f"{name}.json")]
    if not frozen:
        raise DriftDrakeError(f"{command.folder}: nothing is frozen here; begin with 'freeze {command.folder}'")
    again = command.folder / f"again-{sources()}"
    make(again, command.kinds)
    differing = 0
    for name in frozen:
        before, now = (json.loads((folder / f"{name}.json").read_text()) for folder in (command.folder, again))
        lines = list(differences(before, now))
        differing += bool(lines)
        print(f"{name}: " + ("as frozen" if not lines else f"{len(lines)} differences"))
        print("".join(f"  {line}\n" for line in lines[:20]), end="")
        if name == "plans" or not lines:
            for what, (one, other) in times(before, now).items():
                print(f"  {what}: {one:.3g} -> {other:.3g} ({other / max(one, 1e-9):.2f})")
    if differing:
        raise SystemExit(1)


def main(command: Freeze | Compare) -> None:
    """Freezes, or compares."""
    command.folder.mkdir(parents=True, exist_ok=True)
    if isinstance(command, Compare):
        compare(command)
        return
    write_versions(command.folder)
    write_json(command.folder / "sources.json", {"sources": sources()})
    make(command.folder, command.kinds)
    print(f"frozen in {command.folder}")


if __name__ == "__main__":
    run_command(main, Command, __doc__)
