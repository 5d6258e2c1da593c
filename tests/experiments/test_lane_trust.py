"""Who would be refused by informative drives: the table, the picture and the kept limits."""

import json
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.gap.choose.choice import Findings, usual_error, usual_surprise
from experiments.benchmarks.vehicles import EXTREME
from experiments.gathering import lane_trust
from experiments.gathering.beliefs import Taught
from experiments.gathering.lane_trust import GROUPS, LaneTrust, main


def test_groups_are_judged_by_what_is_usual_of_validation_vehicles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rng, asked = np.random.default_rng(0), []

    def gathered(attempts, effects_of, _wanted, _learnt, _gathering, folder, _run_on, car_of):
        name = folder.name
        asked.append((name, len(attempts), car_of(0), effects_of(0).mass_error))
        surprise, as_it_is, further = {
            "extreme": (40.0, 0.0075, 0.0075), "double-track": (30.0, 0.12, 0.0075), "brush": (30.0, 0.04, 0.03),
        }.get(name, (8.0, 0.0072, 0.0072))  # fmt: skip
        shares = np.exp(0.1 * rng.standard_normal((len(attempts), 2)))
        return {
            attempt: Taught({}, surprise * a, {"identified": Findings(None, further * b, as_it_is=as_it_is * b)})
            for attempt, (a, b) in zip(attempts, shares, strict=True)
        }

    monkeypatch.setattr(lane_trust, "gather_all", gathered)
    keep = tmp_path / "kept.json"
    main(LaneTrust(vehicles=12, out=tmp_path / "out", add_to=keep))
    assert [name for name, *_ in asked] == list(GROUPS)
    counts = {name: count for name, count, *_ in asked}
    assert (counts["wide"], counts["extreme"]) == (12, len(EXTREME))
    cars = {name: car for name, _, car, _ in asked}
    assert cars["double-track"] == "double_track"
    assert isinstance(cars["brush"], BrushParameters)
    said = capsys.readouterr().out
    rows = {line.split("|")[1].strip(): [cell.strip() for cell in line.split("|")[2:-1]] for line in said.splitlines()
            if line.startswith("| ")}  # fmt: skip
    assert int(rows["double-track"][-1].split()[0]) >= 11
    assert rows["brush"][-1] == "0 of 12"
    assert rows["extreme"][1] == "4 of 4"
    assert int(rows["extreme"][-1].split()[0]) >= 3  # believed as the identified car
    surprise = usual_surprise(load_model(), keep)
    assert surprise is not None
    assert surprise.mean == pytest.approx(np.log(8.0), abs=0.1)
    assert usual_error(keep).mean == pytest.approx(np.log(0.0072), abs=0.1)
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"lane_trust.png", "report.md", "numbers.json"}
    assert json.loads((tmp_path / "out" / "numbers.json").read_text())["identified"]["vehicles"] == 12
