"""Reliability of stated probabilities: what counts as having happened, bins and their intervals, the picture."""

import json

import numpy as np
import pytest

from experiments.other_worlds.reliability import (
    InvalidRoadError,
    Reliability,
    binned,
    draw_reliability,
    main,
    of_cause,
    of_none,
    of_something_else,
    panels_of,
    read_panels,
    reliability_text,
    rows_of_road,
)
from experiments.other_worlds.scoring import Row


def row(posterior, effects=(), strange=None, left_over=None):
    lead = max(posterior, key=posterior.get)
    verdict = lead if lead in ("none", "unknown") else "effect"
    answer = {
        "verdict": verdict, "causes": lead.split("+") if verdict == "effect" else [], "posterior": posterior,
        "ambiguity": [lead], "magnitudes": {}, "details": {"left_over": left_over or {}},
    }  # fmt: skip
    return Row("a", "coupe", "0123", dict.fromkeys(effects, 0.1), answer, strange)


ROWS = [
    row({"none": 0.9, "unknown": 0.1}),
    row({"mass_error": 0.7, "mass_error+unknown": 0.1, "none": 0.2}, ["mass_error"]),
    row({"mass_error": 0.8, "unknown": 0.15, "none": 0.05}, [], "gyro_drift", {"probability": 0.5}),
    row({"unknown": 0.6, "cg_shift": 0.4}, [], "gyro_drift"),
]


def test_what_is_stated_and_whether_it_happened():
    assert of_none(ROWS) == [(0.9, True), (0.2, False), (0.05, False), (0.0, False)]
    assert of_cause(ROWS) == [(pytest.approx(0.8), True), (0.8, False)]
    stated, there = zip(*of_something_else(ROWS), strict=True)
    np.testing.assert_allclose(stated, [0.1, 0.1, 0.15 + 0.5 * 0.8, 0.6])
    assert there == (False, False, True, True)


def test_bins_hold_every_day_and_their_interval_is_exact():
    bins = binned([(0.0, False), (0.2, True), (1.0, True), (0.97, True), (0.9, False)])
    assert [b.days for b in bins] == [1, 1, 0, 0, 3]
    assert bins[4].stated == pytest.approx((1.0 + 0.97 + 0.9) / 3)
    assert bins[4].happened == pytest.approx(2 / 3)
    assert bins[0].most == pytest.approx(1.0 - 0.025)  # Clopper and Pearson's of none of one, in closed form
    assert not binned([(0.9, False)] * 20)[4].inside
    assert binned([(0.9, True)] * 20)[4].inside


def test_the_table_has_every_bin_of_every_panel():
    lines = reliability_text(panels_of(ROWS)).splitlines()
    assert len(lines) == 2 + 3 * 5
    assert "| no gap | 0.8 to 1.0 | 1 | 0.90 | 1.00 | 0.03 to 1.00 | yes |" in lines
    assert "| the named cause | 0.0 to 0.2 | 0 | - | - | - | - |" in lines


def test_the_picture_tells_what_is_as_stated_by_more_than_colour():
    figure = draw_reliability(panels_of(ROWS))
    assert [ax.get_title(loc="left") for ax in figure.axes] == [
        "no gap", "a fault outside the catalogue", "the named cause",
    ]  # fmt: skip
    assert {line.get_marker() for line in figure.axes[0].lines} >= {"o", "s"}


def make_road(tmp_path):
    """A run folder of one world with an answered and a failed day."""
    world, folder = tmp_path / "world", tmp_path / "run"
    for code in ("aa", "bb"):
        (world / code).mkdir(parents=True)
        (world / code / "run_0.csv").touch()
    (world / "labels.json").write_text(json.dumps({code: {"effects": {}} for code in ("aa", "bb")}))
    (folder / "world").mkdir(parents=True)
    (folder / "config.json").write_text(json.dumps({"worlds": [str(world)]}))
    (folder / "world" / "aa.json").write_text(json.dumps(ROWS[0].answer))
    (folder / "world" / "bb.failed.json").write_text('{"verdict": "refused", "message": "too short"}')
    return folder


def test_a_road_is_read_drawn_and_reported(tmp_path, capsys):
    folder = make_road(tmp_path)
    assert [r.case for r in rows_of_road(folder)] == ["aa"]
    main(Reliability((folder,), tmp_path / "picture.png", tmp_path / "stated.csv"))
    assert (tmp_path / "picture.png").stat().st_size > 10_000
    assert read_panels(tmp_path / "stated.csv") == {
        "no gap": [(0.9, True)], "a fault outside the catalogue": [(0.1, False)],
    }  # fmt: skip
    assert "| no gap | 0.8 to 1.0 | 1 |" in capsys.readouterr().out


def test_a_folder_that_is_no_road_is_refused(tmp_path):
    with pytest.raises(InvalidRoadError, match=r"has no config\.json"):
        rows_of_road(tmp_path)
    (tmp_path / "config.json").write_text('{"worlds": ["nowhere"]}')
    with pytest.raises(InvalidRoadError, match="nowhere is not there"):
        rows_of_road(tmp_path)
    (tmp_path / "config.json").write_text("{}")
    with pytest.raises(InvalidRoadError, match="no answered day"):
        main(Reliability((tmp_path,), tmp_path / "picture.png"))
