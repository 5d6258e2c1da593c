"""What to drive: the plan's driver, and the books of the experiment."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from experiments.gap.what_to_drive import DRIVES, PlanDriver, picture, plain_plan, summarise, table


def case(first: float, planned: float) -> dict[str, object]:
    out: dict[str, object] = {
        "ambiguous": True,
        "truth": {"effects": {"aero_drag": 1.0}},
        "plan": {"after": 0.9},
    }
    for kind, p in zip(DRIVES, (first, 0.5, 0.6, planned), strict=True):
        said = "aero_drag" if p > 0.5 else "none"
        out[kind] = {"probability": p, "said": said, "ambiguity": ["none", "aero_drag"]}
    return out


def test_the_books_count_open_cases_alone():
    cases = [case(0.2, 0.95), case(0.4, 0.7), {"ambiguous": False}]
    summary = summarise(cases)
    assert summary["ambiguous"] == 2
    assert summary["planned"] == {"mean": pytest.approx(0.825), "median": pytest.approx(0.825), "least": 0.7,
                                  "settled": 1, "leads": 2}  # fmt: skip
    assert summary["first log"]["leads"] == 0
    assert "with planned drive | 0.82" in table(summary)
    assert len(picture(cases).axes) == 1


def test_a_plan_is_followed_from_its_own_points():
    vehicle = VehicleParameters()
    x, u = plain_plan(vehicle, 0.5, 3.0)
    driver = PlanDriver(x, u, vehicle)
    delta, _ = driver.command(1.0, x[10], (float(u[10, 0]), float(u[10, 1])))
    assert delta == pytest.approx(u[10, 0] + 0.1 * (u[11, 0] - u[10, 0]), abs=1e-9)
    moved = x[10] + np.array([0.0, 0.0, 0.0, 0.0, 0.5, 0.0])
    assert driver.command(1.0, moved, (float(u[10, 0]), float(u[10, 1])))[0] < delta
