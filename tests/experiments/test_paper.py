"""The page of the paper's claims: verdicts follow from data, parts are run in order and gone on with."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pandas as pd
import pytest

from drift_drake.common.executors import ExecutorConfig
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.plan import Trajectory
from drift_drake.drive.learnt.checkpoint import paper_checkpoint
from experiments.drifting.runs import EXTRAS, reference
from experiments.gathering.recipe import Recipe, as_in_paper
from experiments.paper import __main__ as command
from experiments.paper import claims, drives, parts, tables, verdicts, worth
from experiments.paper.claims import CLAIMS, Evidence, claims_table, failed_at, read_runs, transitions
from experiments.paper.figures import norms_figure
from experiments.paper.parts import KINDS, PaperConfig, tasks
from experiments.paper.verdicts import FEWEST, Cell, falls_short, more, ranked, ratio, share, turned, verdict


def runs_of(model: str, rms_e: Sequence[float], completed: Sequence[bool] | None = None) -> pd.DataFrame:
    """A run a vehicle."""
    count = len(rms_e)
    return pd.DataFrame(
        {
            "model": model, "vehicle": range(count), "noise_seed": 0, "rms_e": rms_e, "rms_sideslip_error": rms_e,
            "completed": [True] * count if completed is None else completed, "completion": 1.0, "drifting": 1.0,
            "solve_ms_median": 2.0, "solver_failures": 0, "outcome": "completed",
        }
    )  # fmt: skip


@pytest.mark.parametrize(
    ("low", "high", "bar", "vehicles", "expected"),
    [
        (0.81, 1.0, 0.8, 8, "holds"),
        (1.0, np.inf, 1.0, 8, "not shown"),
        (0.5, 0.79, 0.8, 8, "does not hold"),
        (0.5, 0.8, 0.8, 8, "not shown"),
        (0.9, 1.0, 0.8, FEWEST - 1, "not shown"),
        (0.0, 0.0, 0.0, 20, "not shown"),  # nothing differs
    ],
)
def test_a_verdict_is_the_intervals(low: float, high: float, bar: float, vehicles: int, expected: str) -> None:
    assert verdict(low, high, bar, vehicles) == expected


def test_shares_and_differences_are_counted_by_vehicle() -> None:
    some, all_ = runs_of("a", [0.1] * 20, [False] * 20), runs_of("b", [0.1] * 20)
    assert share(all_, "completed") == Cell("20 of 20 (83% to 100%)", "holds")
    assert turned(share(some, "completed")).verdict == "holds"
    assert more(all_, some, "completed") == Cell("20 against 0 of 20: +100% (+100% to +100%)", "holds")
    assert more(some, all_, "completed").verdict == "does not hold"
    assert more(all_, all_, "completed").verdict == "not shown"


def test_a_run_that_was_not_completed_is_infinitely_far_off() -> None:
    worse = ranked(runs_of("a", [0.1] * 10, [False] * 9 + [True]), "rms_e")
    better = ranked(runs_of("b", [0.1] * 10), "rms_e")
    assert ratio(worse, better, "rms_e", unit=" m") == Cell(
        "never against 0.10 m, ratio never (never to never)", "holds"
    )
    assert ratio(better, worse, "rms_e").verdict == "does not hold"
    assert ratio(worse, worse, "rms_e").text.endswith("ratio 1.00 (1.00 to 1.00)")


def test_what_is_as_good_to_a_quarter_does_not_fall_short() -> None:
    good = runs_of("twice_info", np.linspace(0.10, 0.12, 12).tolist())
    assert falls_short(runs_of("online", np.linspace(0.11, 0.13, 12).tolist()), good).verdict == "does not hold"
    assert falls_short(runs_of("online", np.linspace(0.2, 0.3, 12).tolist()), good).verdict == "holds"
    failed = runs_of("online", np.linspace(0.10, 0.12, 12).tolist(), [False] * 5 + [True] * 7)
    assert falls_short(failed, good).verdict == "holds"


def test_nothing_run_is_no_verdict(tmp_path: Path) -> None:
    found = {kind: claims.evidence(tmp_path, kind) for kind in KINDS}
    lines = claims_table(found).splitlines()[2:]
    assert len(lines) == len(CLAIMS)
    assert all(line.endswith("| - | not run | - | not run |") for line in lines[:-1])
    assert lines[-1].endswith("| machine busy | not run | machine busy | not run |")
    assert [part for _, _, part, *_ in CLAIMS if part not in get_args(parts.Part)] == []


def test_claims_are_judged_by_the_runs_of_their_part() -> None:
    runs = pd.concat([runs_of("twice_info", [0.1] * 20), runs_of("once_ocp", [0.3] * 20)])
    runs = runs.assign(held=True, past_first=True, in_time=True)
    found = Evidence(runs, claims.NONE, claims.NONE)
    answers = {claim.what: claim.judge(found).verdict for claim in CLAIMS if claim.part == "figure_8"}
    assert answers["Twice-Info's RMS e is below Once-OCP's"] == "holds"
    assert answers["Once-OCP does not complete the figure-8 reliably"] == "does not hold"
    assert answers["active data collection helps: Twice-Info completes more figure-8s than Once-OCP"] == "not shown"
    assert answers["and below Once-Info's"] == "not run"


def test_a_failed_run_is_placed_by_the_transitions(tmp_path: Path) -> None:
    course = reference("figure_8")
    (_, first), (second, _), *_ = transitions(course)
    at = np.array([first - 1.0, 0.5 * (first + second), second + 1.0, course.distance]) / course.distance
    runs = runs_of("once_ocp", [0.1] * 4, [False, False, False, True]).assign(completion=at)
    assert list(failed_at(runs, course)) == ["in transition 1", "before transition 2", "in transition 2"]
    runs.to_csv(tmp_path / "runs.csv", index=False)
    assert list(read_runs(tmp_path / "runs.csv", "figure_8")["past_first"]) == [False, True, True, True]
    said = tables.failures(dict.fromkeys(KINDS, Evidence(runs, claims.NONE, claims.NONE)))
    assert "| Once-OCP | 3 of 4 | before transition 2: completed, 1; in transition 1: completed, 1;" in said
    well = Evidence(runs_of("once_ocp", [0.1] * 4), claims.NONE, claims.NONE)
    assert "| Once-OCP | 0 of 4 | - |" in tables.failures(dict.fromkeys(KINDS, well))


def test_parts_are_in_the_papers_order_under_the_recipe_and_as_shipped(tmp_path: Path) -> None:
    todo = tasks(PaperConfig(vehicles=6, few=2, seeds=3), tmp_path)
    assert list(todo) == [
        "drives", "figure_8/recipe", "figure_8/shipped", "loops/recipe", "loops/shipped", "steps", "worth",
    ]  # fmt: skip
    recipe, shipped = (todo[f"figure_8/{kind}"].args[0] for kind in KINDS)  # type: ignore[attr-defined]
    assert (recipe.as_in_paper, recipe.vehicles, recipe.noise_seeds) == (True, 6, 3)
    assert not shipped.as_in_paper
    assert todo["steps"].args[0].vehicles == 2  # type: ignore[attr-defined]
    assert list(tasks(PaperConfig(parts=("loops",)), tmp_path)) == ["loops/recipe", "loops/shipped"]


def test_a_rebuilt_model_takes_the_papers_place(tmp_path: Path) -> None:
    options = parts.recipe(PaperConfig(rebuild=True), "recipe", tmp_path)
    assert Recipe(**options).resolved().checkpoint == parts.rebuilt_file(tmp_path)
    assert Recipe(**parts.recipe(PaperConfig(), "recipe", tmp_path)).resolved().checkpoint == paper_checkpoint()


def test_one_thing_at_a_time_is_kept() -> None:
    rungs = worth.rungs()
    assert [rung.keep for rung in rungs] == [(), *((name,) for name in EXTRAS), EXTRAS]
    assert [rung.gathering.qp for rung in rungs if rung.keep == ("interior_point",)] == ["stagewise"]
    assert [rung.models for rung in rungs if rung.keep == ("gate",)] == [("online",)]


def test_a_plan_that_steers_the_other_way_first_is_the_same_one() -> None:
    x = np.random.default_rng(0).normal(size=(6, 8))
    plan, mirrored, straight = (Trajectory(a, np.zeros((6, 2)), 0.0, 0.0, "converged") for a in (
        x, np.hstack([drives.MIRRORED * x[:, :6], x[:, 6:]]), np.zeros((6, 8)),
    ))  # fmt: skip
    assert drives.unlike(plan, mirrored, straight) == 0.0
    assert drives.unlike(plan, straight, straight) == 1.0


def test_drives_are_judged_and_gone_on_with(
    tmp_path: Path, here: ExecutorConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = GatheringConfig(steps=10, v_end=9.0, starts=1, learn_lags=False)
    recipe = Recipe(paper_checkpoint(), gathering=as_in_paper(short))
    config = drives.DrivesConfig(recipe, Recipe(gathering=short), 1, 1, "train", 0, here, tmp_path / "drives")
    monkeypatch.setattr(drives, "ALPHAS", ())
    drives.main(config)
    table = pd.read_csv(tmp_path / "drives" / "drives.csv")
    assert list(table["variant"].unique()) == ["recipe", "shipped", "total information", "narrowed lane"]
    assert list(table[table["variant"] == "recipe"]["model"]) == ["prior", "Once-OCP", "Once-Info", "Twice-Info"]
    of = table.set_index(["variant", "model"])["total"]
    assert of["recipe", "prior"] > of["recipe", "Once-Info"] > of["recipe", "Twice-Info"]
    done = {path: path.stat().st_mtime_ns for path in (tmp_path / "drives").glob("*-000.json")}
    drives.main(config)
    assert {path: path.stat().st_mtime_ns for path in done} == done
    found = {kind: claims.evidence(tmp_path, kind) for kind in KINDS}
    assert "| Twice-Info | 0.49 |" in tables.norms(found)
    assert "differs from eq. (9)'s by" in tables.bolder(tmp_path)


def test_the_page_is_written_of_what_there_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[str] = []
    monkeypatch.setattr(parts, "tasks", lambda *_: {"a": lambda: ran.append("a"), "b": lambda: ran.append("b")})
    monkeypatch.setattr(command.figures, "draw_all", lambda *_: ran.append("figures"))
    command.main(dataclasses.replace(PaperConfig(), out=tmp_path))
    assert ran == ["a", "b", "figures"]
    text = (tmp_path / "claims.md").read_text()
    assert text.startswith("# Claims\n")
    assert "| Abstract (i) |" in text
    assert "Table I, by state" not in text


def test_norms_are_drawn_over_time() -> None:
    t = np.arange(5.0)
    axes: Any = norms_figure({"one": (t, np.exp(-t)), "two": (t, np.exp(-2.0 * t))}).axes[0]
    assert [line.get_label() for line in axes.lines] == ["one", "two"]
    assert axes.get_yscale() == "log"
    assert verdicts.NOTHING.verdict == "not run"
