"""The figure-8 once more: who is the reference, and what a run that was not completed counts."""

from typing import Any

from experiments.drifting import covariance
from experiments.drifting.again import text


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
