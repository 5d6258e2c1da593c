"""The replay is one HTML file that needs nothing else, with all cars in it."""

import re

import numpy as np
import pytest

from drift_drake.pictures.replay import read_outs, replay
from drift_drake.vehicle.parameters import VehicleParameters


def test_the_replay_is_one_file_that_loads_nothing_else(eight, perfect_run, tmp_path):
    path = replay({"driven": perfect_run, "ghost": perfect_run.iloc[:200]}, tmp_path / "folder" / "replay.html", eight)
    page = path.read_text()
    assert len(page) > 500_000
    assert not re.search(r"<script[^>]*\ssrc=", page)
    assert not re.search(r"<link[^>]*\shref=[\"']?https?:", page)
    assert not re.search(r"(@import|url\()\s*[\"']?https?:", page)


def test_more_cars_and_longer_runs_make_more_of_it(perfect_run, tmp_path):
    sizes = [
        replay(runs, tmp_path / f"{k}.html").stat().st_size
        for k, runs in enumerate(
            ({"a": perfect_run.iloc[:50]}, {"a": perfect_run}, {"a": perfect_run, "b": perfect_run})
        )
    ]
    assert sizes[0] < sizes[1] < sizes[2]


def test_a_run_without_a_column_is_named(perfect_run, tmp_path):
    with pytest.raises(ValueError, match=r"run 'a' lacks the column\(s\) psi"):
        replay({"a": perfect_run.drop(columns="psi")}, tmp_path / "replay.html")


def test_a_model_cars_scene_is_magnified(perfect_run, tmp_path):
    p = VehicleParameters()
    model = p.replace(front_axle_distance=0.1 * p.front_axle_distance, rear_axle_distance=0.1 * p.rear_axle_distance)
    assert (
        "Drawn 10 times as large." in replay({"a": perfect_run}, tmp_path / "model.html", parameters=model).read_text()
    )
    assert "times as large" not in replay({"a": perfect_run}, tmp_path / "car.html").read_text()


def test_the_panel_names_the_cars_and_a_gap_in_a_run_is_no_error(perfect_run, tmp_path):
    gap = perfect_run.copy()
    gap.loc[gap.index[:20], ["x", "y", "psi"]] = float("nan")
    gap.loc[gap.index[150:170], ["x", "y", "psi"]] = float("nan")
    page = replay({"real": perfect_run, "<ghost>": gap}, tmp_path / "r.html", title="lap", camera="follow").read_text()
    assert "<h1>lap</h1>" in page
    assert page.count("&lt;ghost&gt;") == 2
    assert "let following = true" in page


def test_the_panel_reads_out_what_all_runs_have_in_a_drivers_units(perfect_run, tmp_path):
    gap = perfect_run.copy()
    gap.loc[gap.index[:20], "v"] = float("nan")
    slip, speed, yaw = read_outs({"real": perfect_run, "nominal": gap})
    assert [signal["name"] for signal in (slip, speed, yaw)] == ["slip", "speed", "yaw"]
    assert speed["cars"][0][0] == pytest.approx(3.6 * perfect_run["v"].iloc[0], abs=0.01)
    assert speed["cars"][1][0] is None
    assert speed["step"] * (len(speed["cars"][0]) - 1) == pytest.approx(np.ptp(perfect_run["t"]), abs=speed["step"])
    assert read_outs({"real": perfect_run.drop(columns=["v", "beta", "r"])}) == []
    page = replay({"real": perfect_run}, tmp_path / "r.html", title="<lap>").read_text(encoding="utf-8")
    assert "<title>&lt;lap&gt;</title>" in page
