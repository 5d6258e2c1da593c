"""Numbers and tables of closed-loop runs."""

import pandas as pd
import pytest

from experiments.drifting.report import (
    choice_sentence,
    completion_table,
    ordering_table,
    over_oracle_table,
    paper_table,
    picture_sentence,
    pictured_runs,
    pictured_vehicle,
    plans_sentence,
    refusal_sentence,
    summarise,
)


@pytest.fixture
def runs() -> pd.DataFrame:
    """Two vehicles, three attempts each, with two models; the last run of Twice-Info arrives gripping."""
    return pd.DataFrame({
        "model": ["twice_info"] * 6 + ["oracle"] * 6,
        "vehicle": [0, 0, 0, 1, 1, 1] * 2,
        "completed": [True, True, False, True, True, True] + [True] * 6,
        "drifting": [1.0, 0.95, 0.4, 1.0, 1.0, 0.2] + [1.0] * 6,
        "completion": [1.0, 1.0, 0.4, 1.0, 1.0, 1.0] + [1.0] * 6,
        "outcome": ["completed", "completed", "spin", "completed", "completed", "completed"] + ["completed"] * 6,
        "rms_e": [0.1, 0.2, 2.0, 0.3, 0.4, 0.5] + [0.1] * 6,
        "rms_sideslip_error": [0.01, 0.02, 0.3, 0.03, 0.04, 0.05] + [0.02] * 6,
        "second_plan": [True] * 5 + [False] + [None] * 6,
        "solve_ms_median": [1.0] * 12,
        "solver_failures": [3, 0, 1, 0, 0, 0] + [0] * 6,
    })  # fmt: skip


def test_gripping_round_the_course_is_not_drifting_it(runs: pd.DataFrame) -> None:
    twice = summarise(runs)["twice_info"]
    assert twice["completed"] == pytest.approx(5.0 / 6.0)
    assert twice["drifted"] == pytest.approx(4.0 / 6.0)
    assert twice["vehicles_always_drifted"] == 0
    assert twice["outcomes"] == {"completed": 5, "spin": 1}
    assert twice["solver_failures"] == 4
    assert twice["without_second_plan"] == 1
    assert summarise(runs)["oracle"]["without_second_plan"] == 0


def test_a_run_that_is_not_completed_ranks_behind_all_others(runs: pd.DataFrame) -> None:
    twice = summarise(runs)["twice_info"]
    assert (twice["rms_e"]["least"], twice["rms_e"]["median"], twice["rms_e"]["most"]) == (0.1, 0.4, float("inf"))
    assert twice["rms_e_until_the_end"]["most"] == 2.0
    # Best of each vehicle 0.1 and 0.3, median 0.2 and 0.4, worst 2.0 and 0.5; in the median of the two.
    assert twice["rms_e_of_attempts"] == pytest.approx({"best": 0.2, "median": 0.3, "worst": 1.25})


def test_intervals_are_of_vehicles(runs: pd.DataFrame) -> None:
    summary = summarise(runs)
    # Resampled, both are the one vehicle, or the other: two of three attempts, or all.
    assert summary["twice_info"]["completed_interval"] == pytest.approx((2.0 / 3.0, 1.0))
    low, high = summary["oracle"]["completed_interval"]
    assert (low, high) == (pytest.approx(0.025 ** (1.0 / 2.0)), 1.0)  # two of two vehicles, exactly


def test_tables_are_markdown(runs: pd.DataFrame) -> None:
    summary = summarise(runs)
    lines = completion_table(summary).splitlines()
    assert lines[2] == (
        "| Twice-Info | 83% (67% to 100%) | 67% (67% to 67%) | 0 of 2 vehicles | 1 "
        "| 0.10 / 0.40 (0.20 to 0.40) / - | 0.040 (0.020 to 0.040) |"
    )
    assert paper_table(summary, "rms_e").splitlines() == [
        "| of a vehicle's attempts | Twice-Info, paper | here | oracle |",
        "| --- | --- | --- | --- |",
        "| best | 0.61 | 0.20 | 0.10 |",
        "| median | 0.83 | 0.30 | 0.10 |",
        "| worst | 1.29 | 1.25 | 0.10 |",
    ]


def test_what_the_lane_forecast_is_counted(runs: pd.DataFrame) -> None:
    assert refusal_sentence(summarise(runs)) == ""
    twice = runs[runs["model"] == "twice_info"].assign(refused=[False, True, True, False, False, False])
    twice.loc[0, "completed"] = False
    assert refusal_sentence(summarise(twice)).startswith(
        "By the informative drives' logs, Twice-Info: 2 of 6 runs refused beforehand, 1 of the others were"
    )


def test_what_the_drives_identified_is_counted(runs: pd.DataFrame) -> None:
    assert choice_sentence(runs) == ""
    chosen = runs.iloc[:3].assign(
        model="chosen", believed=["identified", "adapting", "identified"], double_track=[False, False, True],
        one_more=["steering_delay 0.1 s", "gyro_bias 0.02 rad/s, sideslip_bias 0.03 rad", None],
    )  # fmt: skip
    assert choice_sentence(pd.concat([runs, chosen])) == (
        "Chosen by the drives: identified 2, adapting 1; identified with an additional fault: steering_delay 1, "
        "gyro_bias 1; as a double-track car: 1.\n\n"
    )
    assert choice_sentence(chosen.assign(model="chosen_once")).startswith("Chosen by the first drive: identified 2, ")


def test_errors_are_compared_with_the_oracles_on_the_same_attempts() -> None:
    rows = [
        ("oracle", 0, True, 0.1, 0.2), ("oracle", 1, True, 0.2, 0.7), ("oracle", 2, False, 0.1, 3.0),
        ("chosen", 0, True, 0.2, 0.6), ("chosen", 1, True, 0.22, 0.9), ("chosen", 2, True, 0.1, 0.2),
        ("online", 0, True, 0.1, 0.2), ("online", 1, False, 0.05, 0.1), ("online", 2, True, 9.0, 9.0),
    ]  # fmt: skip
    runs = pd.DataFrame(rows, columns=["model", "vehicle", "completed", "rms_e", "max_e"]).assign(noise_seed=0)
    assert over_oracle_table(runs).splitlines()[2:4] == [
        "| chosen by the drives | 1.55 | 2.00 | 1 of 2 | 1 of 2 |",
        "| prior, adapting | - | - | 1 of 2 | 0 of 2 |",
    ]
    assert over_oracle_table(runs[runs["model"] != "oracle"]) == ""


def test_the_papers_models_are_ordered_pair_by_pair() -> None:
    """One of two vehicles is completed more often and further in, of the other both are at the same error."""
    rows = [
        ("prior", 0, False, 0.2, 1.0), ("prior", 0, True, 0.5, 2.0), ("prior", 1, True, 1.0, 0.3),
        ("prior", 1, True, 1.0, 0.3), ("twice_info", 0, True, 1.0, 0.4), ("twice_info", 0, True, 0.5, 0.6),
        ("twice_info", 1, True, 1.0, 0.3), ("twice_info", 1, True, 1.0, 0.3), ("oracle", 0, True, 1.0, 0.1),
    ]  # fmt: skip
    runs = pd.DataFrame(rows, columns=["model", "vehicle", "completed", "drifting", "rms_e"])
    assert ordering_table(runs).splitlines()[2:] == [
        "| Twice-Info less prior | +25% (+0% to +50%) | +25% (+0% to +50%) | 1 of 1 vehicles |",
        "",
    ]
    assert ordering_table(runs[runs["model"] != "prior"]) == ""


@pytest.fixture
def several() -> pd.DataFrame:
    """Three vehicles: on 0 the prior completes nothing, 1 is the worst of the two on which both do, 2 the better."""
    return pd.DataFrame({
        "model": ["prior", "prior", "twice_info"] * 3,
        "vehicle": [0, 0, 0, 1, 1, 1, 2, 2, 2],
        "noise_seed": [0, 1, 0] * 3,
        "completed": [False, False, True, True, True, True, True, False, True],
        "rms_e": [0.01, 0.02, 0.1, 1.0, 1.2, 0.5, 0.4, 0.05, 0.2],
    })  # fmt: skip


def test_the_runs_that_are_pictured_are_completed_ones_of_one_vehicle(several: pd.DataFrame) -> None:
    """By RMS e alone, a run that was lost at once would be the prior's median one."""
    models = ["prior", "twice_info"]
    assert pictured_vehicle(several, models) == 2  # the lower middle of two
    runs = pictured_runs(several, models)
    assert {model: (run["vehicle"], run["rms_e"]) for model, run in runs.items()} == {
        "prior": (2, 0.4), "twice_info": (2, 0.2),
    }  # fmt: skip
    assert picture_sentence(several, models) == ("time_series.png: vehicle 2, each model's median completed run.\n\n")


def test_a_model_that_completed_none_on_that_vehicle_is_named(several: pd.DataFrame) -> None:
    lost = several.assign(completed=several["completed"] & (several["model"] != "prior"))
    assert list(pictured_runs(lost, ["prior", "twice_info"])) == ["twice_info"]
    assert "prior: none completed on it, none shown" in picture_sentence(lost, ["prior", "twice_info"])
    nothing = several.assign(completed=False)
    assert list(pictured_runs(nothing, ["prior", "twice_info"])) == ["prior", "twice_info"]
    assert "none was completed" in picture_sentence(nothing, ["prior", "twice_info"])


def test_second_plans_that_failed_are_counted(runs: pd.DataFrame) -> None:
    assert "Twice-Info 1 of 6 runs" in plans_sentence(summarise(runs))
    assert plans_sentence(summarise(runs.assign(second_plan=True))) == ""
