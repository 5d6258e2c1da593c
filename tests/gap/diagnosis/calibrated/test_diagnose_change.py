"""Changes of a car that no single-track model follows: verdicts, magnitudes, what an answer holds, bad logs."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from drift_drake.car.log.table import InvalidLogError
from drift_drake.gap.diagnosis.answers.answer import read_answer
from drift_drake.gap.diagnosis.answers.apply import corrected_vehicle
from drift_drake.gap.diagnosis.calibrated import diagnose_change as changed_day
from drift_drake.gap.diagnosis.calibrated.diagnose_change import (
    brought_along,
    left_over_sentence,
    ranked_hypotheses,
)
from drift_drake.gap.diagnosis.calibrated.posterior import interval
from drift_drake.gap.estimation.reduction import Reduction
from drift_drake.gap.evidence.constants import PRIORS
from drift_drake.gap.evidence.hypotheses import Hypothesis


def test_a_part_of_the_day_of_calibration_is_normal(plain_day):
    answer = plain_day.answer
    assert answer.verdict == "none"
    assert answer.causes == []
    assert answer.magnitudes == {}
    assert answer.details["with"] == {}
    assert answer.details["decision"] == "none"
    assert "no gap beyond the car's calibrated baseline" in answer.sentence()
    assert "at a false-alarm rate of 0.05" in answer.sentence()
    assert "These logs" in answer.sentence()  # and what they could show


def test_late_steering_is_named_and_its_interval_holds_the_truth(late_day):
    answer = late_day.answer
    assert answer.causes == ["steering_delay"]
    m = answer.magnitudes["steering_delay"]
    assert m.low < 0.08 < m.high
    assert answer.posterior["steering_delay"] > 0.5
    assert answer.reduction.estimate > 0.5
    assert answer.reduction.low <= answer.reduction.estimate <= answer.reduction.high <= 1.0


def test_the_detection_limit_of_what_was_named_is_below_it(late_day):
    limit = late_day.answer.details["detection"]["steering_delay"]
    assert limit["unit"] == "s"
    assert limit["least"] < 0.08


def test_a_cause_that_leaves_nothing_over_is_the_cause(late_day):
    assert late_day.answer.details["decision"] == "cause"
    assert late_day.answer.details["left_over"] == {}


def test_what_is_left_over_has_signals_and_driving(strange_day):
    left = strange_day.answer.details["left_over"]
    assert sum(left["signals"].values()) == pytest.approx(1.0)
    assert 0.0 <= left["share"] <= 1.0
    assert left_over_sentence(left) in strange_day.answer.warnings
    assert "no catalogued effect explains" in left_over_sentence(left)


@pytest.mark.slow
def test_soft_rear_tyres_are_the_nearest_known_at_least_and_their_interval_holds_the_truth(other_car, diagnosed):
    found = diagnosed(other_car.day({"rear_stiffness_error": -0.35}, 3))
    assert found.answer.verdict != "none"
    leading = found.ranked.leading
    m = interval(leading, leading.names.index("rear_stiffness_error"))
    assert m.low < -0.35 < m.high


def test_shares_of_the_gap_sum_to_one(late_day):
    where = late_day.answer.where
    assert sum(where["states"].values()) == pytest.approx(1.0)
    assert sum(where["runs"].values()) == pytest.approx(1.0)
    assert list(where["runs"]) == ["run_0", "run_1", "run_2", "run_3"]
    assert all(0.0 <= t <= 6.0 for t in where["onset"].values())
    assert list(late_day.answer.details["reduction_by_horizon"]) == ["0.1 s", "0.2 s", "0.3 s", "0.4 s", "0.5 s"]


def test_a_gap_that_nothing_explains_is_unknown_and_has_a_place(strange_day):
    answer = strange_day.answer
    assert answer.verdict == "unknown"
    assert answer.causes == []
    assert sum(answer.where["states"].values()) == pytest.approx(1.0)
    assert max(answer.where["states"], key=answer.where["states"].get) == "r"
    # A yaw rate in another unit is one whose error has the sign of the turn.
    assert "It acts like gyro_bias by direction of the turn." in answer.sentence()


def test_an_answer_survives_json(late_day, tmp_path):
    late_day.answer.write(tmp_path / "answer.json")
    again = read_answer(tmp_path / "answer.json")
    assert again.sentence() == late_day.answer.sentence()
    json.loads((tmp_path / "answer.json").read_text())


def test_the_corrected_car_is_the_hypothesis(late_day, other_car):
    day, h = late_day.search.day, late_day.ranked.leading
    vehicle, effects = corrected_vehicle(other_car.found.vehicle, late_day.answer, own=other_car.found.effects)
    again = dataclasses.replace(day, constants=vehicle.constants(), own=effects)
    np.testing.assert_allclose(again.errors_with({}), day.errors_with(h.effects(day)), atol=1e-9)


@pytest.mark.parametrize("names", [("mass_error",), ("mass_error", "rear_stiffness_error")])
def test_stiffnesses_that_follow_the_load_are_applied_too(late_day, other_car, names, tmp_path):
    day = late_day.search.day
    h = Hypothesis(names, np.array([0.12, -0.2][: len(names)]), np.eye(len(names)), 0.0, 0.0, follows_load=1.0)
    along = brought_along(h, day)
    assert along == pytest.approx({"front_stiffness_error": 0.12, "rear_stiffness_error": 0.12})
    answer = dataclasses.replace(
        late_day.answer, verdict="effect", causes=list(names), posterior={"+".join(sorted(names)): 1.0},
        details=late_day.answer.details | {"with": along},
        magnitudes={name: dataclasses.replace(late_day.answer.reduction, estimate=float(q))
                    for name, q in zip(names, h.magnitudes, strict=True)},
    )  # fmt: skip
    answer.write(tmp_path / "answer.json")
    vehicle, effects = corrected_vehicle(other_car.found.vehicle, read_answer(tmp_path / "answer.json"),
                                         own=other_car.found.effects)  # fmt: skip
    again = dataclasses.replace(day, constants=vehicle.constants(), own=effects)
    np.testing.assert_allclose(again.errors_with({}), day.errors_with(h.effects(day)), atol=1e-6)


def hypothesis(name, magnitude, deviation=0.01, nats=1.0):
    return Hypothesis((name,), np.array([magnitude]), np.array([[deviation**2]]), nats, -nats)


def shrinking(by):
    """In place of `reduction`: an estimate by hypothesis."""

    def reduction(_search, h, _best):
        return Reduction(by.get(h.names, 0.0), 0.0, 0.0, {}, {}, [], [], [])

    return reduction


def test_a_cause_that_cannot_be_distinguished_from_zero_is_none(late_day, monkeypatch):
    monkeypatch.setattr(changed_day, "reduction", shrinking({("gyro_bias",): 0.9}))
    monkeypatch.setattr(changed_day, "gross", lambda *_: 1.0)
    monkeypatch.setattr(changed_day, "stated", lambda _, h: h)
    none = Hypothesis((), np.zeros(0), np.zeros((0, 0)), 40.0, -40.0)
    found, _ = ranked_hypotheses(late_day.search, none, [hypothesis("gyro_bias", 0.03, deviation=0.02)], PRIORS)
    assert found.leading.names == ()
    found, _ = ranked_hypotheses(late_day.search, none, [hypothesis("gyro_bias", 0.03)], PRIORS)
    assert found.verdict == "effect"


def test_what_recordings_differ_by_is_no_gross_gap(late_day):
    search, none = late_day.search, late_day.search.none()
    apart = dataclasses.replace(search.normal, recording=100.0 * search.normal.recording)
    alike = dataclasses.replace(search.normal, recording=0.0 * search.normal.recording)
    sizes = [changed_day.gross(SimpleNamespace(day=search.day, normal=normal), none) for normal in (alike, apart)]
    assert sizes[1] < 0.5 * sizes[0]


def test_none_is_no_answer_to_scores_too_far_from_normal(late_day, monkeypatch):
    monkeypatch.setattr(changed_day, "reduction", shrinking({}))
    monkeypatch.setattr(changed_day, "gross", lambda *_: 1.0)
    for nats, verdict in ((99.0, "none"), (101.0, "unknown")):
        none = Hypothesis((), np.zeros(0), np.zeros((0, 0)), nats, -nats, scores=200)
        monkeypatch.setattr(changed_day, "FARTHEST", 1.0)
        found, _ = ranked_hypotheses(late_day.search, none, [], PRIORS)
        assert (found.verdict, found.leading.names) == (verdict, ())


def test_causes_that_remove_nothing_are_none_however_many(late_day, monkeypatch):
    monkeypatch.setattr(changed_day, "reduction", shrinking({("mass_error",): 0.4}))
    monkeypatch.setattr(changed_day, "gross", lambda *_: 1.0)
    monkeypatch.setattr(changed_day, "stated", lambda _, h: h)
    none = Hypothesis((), np.zeros(0), np.zeros((0, 0)), 60.0, -60.0)
    useless = [hypothesis(name, 0.03, nats=float(i)) for i, name in
               enumerate(("gyro_bias", "sideslip_bias", "road_grade", "cg_shift", "aero_drag"))]  # fmt: skip
    found, _ = ranked_hypotheses(late_day.search, none, [*useless, hypothesis("mass_error", 0.1, nats=20.0)], PRIORS)
    assert found.leading.names == ("mass_error",)
    found, shrinks = ranked_hypotheses(late_day.search, none, useless, PRIORS)
    assert found.leading.names == ()
    assert shrinks.estimate == 0.0


def test_a_magnitude_at_the_end_of_what_is_possible_is_a_bound(late_day):
    details = late_day.answer.details | {"at_least": ["steering_delay"]}
    said = dataclasses.replace(late_day.answer, details=details).sentence()
    assert " s at least" in said
    assert "95 %:" not in said


def test_too_little_driving_is_refused(other_car, diagnosed):
    with pytest.raises(InvalidLogError, match=r"short: .* s of driving can be used, 5 s are the least") as error:
        diagnosed([run.rows(0, 200) for run in other_car.runs], "short")
    assert str(error.value).count("\n") == 0


def test_parts_without_a_window_are_refused_as_too_short(other_car, diagnosed):
    fast = []
    for run in other_car.runs[:1]:
        t = np.arange(160) * 0.002  # a log of 500 Hz, a third of a second long
        columns = {name: np.interp(t, run.t, run.column(name)) for name in ("r", "v", "beta", "omega_r", "psi")}
        commands = {name: np.interp(t, run.t, run.column(name)) for name in ("delta_cmd", "tau_cmd")}
        fast.append(dataclasses.replace(run, t=t, x=None, y=None, ax=None, ay=None, **columns, **commands))
    with pytest.raises(InvalidLogError, match=r"0 s in all are too little"):
        diagnosed(fast, "short")


def test_a_log_without_sideslip_is_refused(other_car, diagnosed):
    with pytest.raises(InvalidLogError, match="day: column beta is missing"):
        diagnosed([run.without("beta") for run in other_car.runs])
