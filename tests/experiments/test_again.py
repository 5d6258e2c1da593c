"""The figure-8 once more: who is the reference, what a run that was not completed counts, and what teaches what."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.log.cases import runs_of
from drift_drake.drive.learnt.checkpoint import load_varied
from experiments.drifting import again, covariance, onward
from experiments.drifting.again import text
from experiments.drifting.runs import reference


def attempt(rms_e: float, outcome: str = "completed") -> dict[str, Any]:
    return {"outcome": outcome, "rms_e": rms_e, "rms_sideslip_error": 0.1 * rms_e}


def row(vehicle: int, **attempts: dict[str, Any]) -> dict[str, Any]:
    return {"vehicle": vehicle, "errors": {}, "within": 0.5 + 0.1 * vehicle, "refused": "", "attempts": attempts}


def test_errors_are_relative_to_the_best_of_the_identified_cars() -> None:
    rows = [
        row(0, first=attempt(0.3), **{"double-track": attempt(0.1), "brush": attempt(0.2)}),
        row(1, first=attempt(0.01, "spin"), **{"double-track": attempt(0.05, "spin"), "brush": attempt(0.4)}),
        row(2, first=attempt(0.2), **{"double-track": attempt(0.2), "brush": attempt(0.4)}),
    ]
    lines = text(rows).splitlines()
    cells = {line.split(" | ")[0].strip("| "): line.strip("| ").split(" | ") for line in lines if line.startswith("|")}
    assert cells["first"][1:4] == ["2 of 3", "0.300", "0.030"]  # the spin ranks behind the others
    assert cells["first"][4].startswith("3.00 (1.00 to inf)")
    assert cells["double-track"][1] == "2 of 3"
    assert cells["reference"][1:3] == ["3 of 3", "0.200"]  # of 0.1, 0.4, 0.2
    assert lines[-1].startswith("The reference is of the kind: double-track 2, brush 1; 0.50 to 0.70 of")


def test_the_covariances_report_has_a_row_a_car_and_the_range_of_both_shares() -> None:
    rows = [{"vehicle": i, "outcome": "completed", "samples": 270, "stated": 0.2 + 0.3 * i, "learnt": 0.95 - 0.02 * i}
            for i in range(2)]  # fmt: skip
    said = covariance.text(rows)
    assert "| 1 | completed | 270 | 0.500 | 0.930 |" in said
    assert said.endswith("Of 0.95 stated: 0.200 to 0.500; with the car's own noise 0.930 to 0.950.")


def on_course(held: float) -> pd.DataFrame:
    """A log of a car that follows the figure-8 with a share of its sideslip."""
    course = reference("figure_8")
    t = np.arange(0.0, course.duration, 0.01)
    s = course.position(t)
    x, u = course.state(s), course.input(s)
    turned = held * x[:, 2]
    r = x[:, 0] + np.gradient(x[:, 2] - turned, t)  # the course stays
    return pd.DataFrame({"t": t, "r": r, "v": x[:, 1], "beta": turned, "omega_r": x[:, 3], "delta_cmd": u[:, 0],
                         "tau_cmd": u[:, 1]})  # fmt: skip


def test_drives_begin_with_what_those_before_taught_that_held_their_drifts(monkeypatch: pytest.MonkeyPatch) -> None:
    began = dict[str, int]()  # with so many drives' teaching, by the order of the drives
    monkeypatch.setattr(again, "adapting_after", lambda taught, *_: len(taught))

    def drifted(_: again.Vehicle, believes: int, seed: int, maneuver: str) -> tuple[pd.DataFrame, dict[str, Any]]:
        began[list(onward.DRIVES)[seed]] = believes
        return on_course(0.2 if maneuver == "gentle" else 1.0), {"outcome": "completed"}

    monkeypatch.setattr(again.Vehicle, "drifted", drifted)
    onward.driven_on(again.Vehicle("brush", 0, 0))
    assert list(began.values()) == [0, 0, 0, 0, 1, 1]  # the gentle drive gripped
    (gripped,) = runs_of([on_course(0.2)])
    monkeypatch.undo()
    beliefs = again.after([gripped]).earlier
    assert beliefs is not None
    np.testing.assert_array_equal(beliefs.posteriors[0].mean, load_varied().prior().mean)


def test_the_report_has_a_row_a_drive() -> None:
    drives = {name: attempt(0.2) | {"drifting": 0.95} for name in onward.DRIVES}
    lost = drives | {onward.FIRST: attempt(0.1, "spin") | {"drifting": 0.3}}
    lines = onward.text([{"vehicle": i, "drives": one} for i, one in enumerate((drives, lost, lost))]).splitlines()
    assert len(lines) == 2 + len(onward.DRIVES)
    assert f"| {onward.FIRST} | 1 of 3 | 1 of 3 | 2 | inf | inf |" in lines
    assert f"| {onward.AFTER} | 3 of 3 | 3 of 3 | 0 | 0.200 | 0.020 |" in lines
