"""What would fix an import: the columns that physics speaks for, and a mapping changed by one click, which is right."""

import copy
import re

import numpy as np
import pandas as pd
import pytest
from importing_bench import WHEELBASE, rows

from drift_drake.gap.logs.importing.candidates import ranked
from drift_drake.gap.logs.importing.importer import PERIOD
from drift_drake.gap.logs.importing.preview import preview
from drift_drake.gap.logs.importing.recording import topics_of
from drift_drake.gap.logs.screening.overlays import overlays

SI = {"psi": "rad", "r": "rad/s", "v": "m/s", "beta": "rad", "omega_r": "m/s", "ax": "m/s^2", "ay": "m/s^2",
      "delta_cmd": "rad"}  # fmt: skip


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A drive's columns under names that say nothing, in SI."""
    path = tmp_path_factory.mktemp("preview") / "drive.csv"
    table = pd.DataFrame(rows(noise=1.0))[["t", *SI]]
    table.rename(columns={name: f"ch{k}" for k, name in enumerate(SI)}).to_csv(path, index=False)
    return path, topics_of(path)


def mapped(**changes):
    """A right mapping, but for some lines."""
    signals = {name: {"column": f"ch{k}", "unit": unit} for k, (name, unit) in enumerate(SI.items())}
    for name, line in changes.items():
        signals[name] |= line
    return {"clocks": {"c": {"column": "t"}}, "signals": signals, "wheelbase": WHEELBASE}


def test_nothing_is_said_of_what_is_right(recording):
    found = preview(*recording, mapped())
    assert found.refused is None
    assert found.remarks == []


@pytest.mark.parametrize(
    ("wrong", "label"),
    [
        ({"beta": {"scale": 57.3}}, "read beta in deg"),
        ({"v": {"unit": "km/h"}, "omega_r": {"unit": "km/h"}}, "read v in m/s"),
        ({"ay": {"sign": -1.0}}, "turn the sign of ay"),
        ({"ay": {"unit": "g"}}, "read ay in m/s^2"),
        ({"delta_cmd": {"scale": 15.0}}, "divide delta_cmd by"),
        ({"r": {"offset": 0.03}}, "add -0.03 to r"),
        ({"ax": {"column": "ch6"}, "ay": {"column": "ch5"}}, "exchange the columns of ax and ay"),
    ],
)
def test_one_click_puts_a_mistake_right(recording, wrong, label):
    data = mapped(**wrong)
    before = copy.deepcopy(data)
    for _ in range(3):
        found = preview(*recording, data)
        if not found.remarks and found.refused is None:
            break
        offered = [fix for remark in found.remarks for fix in remark.fixes]
        chosen = next((fix for fix in offered if fix.label.startswith(label[:20])), offered[0])
        data = chosen.mapping
    assert data != before
    assert preview(*recording, data).remarks == []


@pytest.mark.parametrize(("seconds", "says"), [(24.0, "understeer aside"), (10.0, "an upper estimate")])
def test_the_ratio_of_a_steering_wheel_is_that_of_gentle_turns(recording, seconds, says):
    """Of all driving together it would be 19.6."""
    (remark,) = preview(*recording, mapped(delta_cmd={"scale": 15.0}), end=seconds).remarks
    assert says in remark.sentence
    (fix,) = remark.fixes
    ratio = 15.0 / fix.mapping["signals"]["delta_cmd"]["scale"]
    assert ratio > 17.0 if seconds < 24.0 else ratio == pytest.approx(15.0, rel=0.05)
    numbers = [float(q) for q in re.findall(r"\d+\.\d+", remark.sentence.split(" times")[0])]
    assert numbers == pytest.approx([ratio], rel=0.01) if seconds < 24.0 else numbers[1] < 15.0 < numbers[2]


@pytest.mark.parametrize("name", ["r", "psi"])
def test_one_click_puts_a_late_column_on_the_others_clock(recording, name):
    data = mapped(**{name: {"clock": "late"}})
    data["clocks"]["late"] = {"column": "t", "offset": 0.4}
    (remark,) = preview(*recording, data).remarks
    assert remark.sentence.startswith(f"{name} comes 0.")
    (fix,) = remark.fixes
    assert fix.mapping["signals"][name]["clock"] == f"late_{name}"
    assert fix.mapping["clocks"][f"late_{name}"]["offset"] == pytest.approx(0.0, abs=0.03)
    assert preview(*recording, fix.mapping).remarks == []


def test_a_fix_leaves_the_mapping_that_it_is_of_as_it_was(recording):
    data = mapped(ay={"unit": "g"})
    before = copy.deepcopy(data)
    (remark,) = preview(*recording, data).remarks
    assert data == before
    assert remark.fixes[0].mapping["signals"]["ay"]["unit"] == "m/s^2"
    assert {**remark.fixes[0].mapping, "signals": None} == {**before, "signals": None}


def test_a_refused_log_has_its_fix_too(recording):
    wrong = mapped(r={"scale": 180.0 / np.pi})
    found = preview(*recording, wrong)
    assert found.refused is not None
    assert "looks like degrees per second" in found.refused.sentence
    assert found.refused.fixes[0].mapping["signals"]["r"]["unit"] == "deg/s"


def test_what_cannot_be_read_is_refused_in_a_sentence(recording):
    assert "signals.r.unit is '?'" in preview(*recording, mapped(r={"unit": "?"})).refused.sentence
    data = mapped()
    data["signals"].pop("v")
    assert "nothing gives v" in preview(*recording, data).refused.sentence


def test_columns_without_names_are_ranked_by_motion(recording):
    """With three of them chosen, the others are found."""
    _, topics = recording
    signals = {name: line for name, line in mapped()["signals"].items() if name in ("r", "v", "ay")}
    found = ranked(topics, signals)
    best = {name: found[name][0].column for name in ("psi", "omega_r", "delta_cmd", "beta")}
    assert best["psi"] == "ch0"
    assert best["beta"] == "ch3"
    assert {best["omega_r"], found["omega_r"][1].column} == {"ch2", "ch4"}
    assert "ch7" in [one.column for one in found["delta_cmd"][:3]]
    assert found["r"][0].column == "ch1" or found["r"][0].says == "ay / v"


def test_overlays_lie_on_each_other_where_all_is_right(recording):
    pieces = preview(*recording, mapped()).pieces
    for one in overlays(pieces, PERIOD, WHEELBASE):
        assert one.likeness > 0.95, one
        assert abs(one.gain - 1.0) < 0.3 or one.column == "delta_cmd"
    (turned,) = [one for one in overlays(preview(*recording, mapped(ay={"sign": -1.0})).pieces, PERIOD)
                 if one.column == "ay"]  # fmt: skip
    assert turned.gain < -0.9
