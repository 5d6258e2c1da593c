"""What the next drive is planned from after a change: rivals, and effects that the logs could not show."""

import dataclasses

import numpy as np
import pytest

from drift_drake.gap.diagnosis.answers.answer import UnplannableError
from drift_drake.gap.diagnosis.calibrated.posterior import DetectionLimit, change_beliefs, hidden
from drift_drake.gap.evidence.constants import PRIORS
from drift_drake.gap.next_drive.foresight import beliefs_of
from drift_drake.gap.next_drive.plan import NextDriveConfig, plan_from_answer


def test_a_cause_is_believed_with_its_deviation(late_day):
    beliefs = late_day.answer.details["beliefs"]["hypotheses"]
    m = late_day.answer.magnitudes["steering_delay"]
    assert beliefs["steering_delay"]["theta"][-1] == pytest.approx(m.estimate)
    assert beliefs["steering_delay"]["root"][-1][-1] == pytest.approx((m.high - m.low) / (2.0 * 1.96))


def test_a_cause_without_a_rival_needs_no_drive(late_day):
    with pytest.raises(UnplannableError, match="late: steering_delay has no rival left"):
        beliefs_of(late_day.answer)


def test_after_none_the_rivals_are_what_the_logs_could_not_show(plain_day):
    search = plain_day.search
    far = {name: DetectionLimit("-", None, "none") for name in ("friction_level", "torque_gain_error")}
    near = {name: DetectionLimit("-", 0.01 * r.high, "none") for name, r in search.ranges.items() if name not in far}
    assert hidden(search, far | near)[0] == "friction_level"  # which changes more often from day to day
    data = change_beliefs(search, plain_day.ranked, [search.none()], far | near, PRIORS)
    assert list(data["hypotheses"]) == ["none", "friction_level", "torque_gain_error"]
    assert data["hypotheses"]["torque_gain_error"]["theta"][-1] == pytest.approx(-0.15)  # half of its practical range
    details = plain_day.answer.details | {"beliefs": data}
    sensing, beliefs = beliefs_of(dataclasses.replace(plain_day.answer, details=details))
    assert [b.name for b in beliefs] == ["none", "friction_level", "torque_gain_error"]
    np.testing.assert_allclose(sensing.noise[0], search.normal.scales[0, 0])
    assert 0.0 < sensing.tempering < 0.01


def test_a_drive_is_planned_from_the_answer_to_a_change(late_day, other_car):
    limits = {"friction_level": DetectionLimit("-", None, "none")}
    none = dataclasses.replace(late_day.ranked, leading=late_day.search.none(), probabilities={"none": 1.0})
    data = change_beliefs(late_day.search, none, [late_day.search.none()], limits, PRIORS)
    answer = dataclasses.replace(late_day.answer, details=late_day.answer.details | {"beliefs": data})
    short = NextDriveConfig(steps=15, v_end=11.0, starts=1, max_iterations=15)
    drive = plan_from_answer(answer, other_car.found.vehicle, short, other_car.found.effects)
    assert drive.names == ("none", "friction_level")
    assert drive.after > drive.before


def test_without_torque_there_is_nothing_to_plan(late_day):
    runs = [dataclasses.replace(run, fed=True) for run in late_day.search.day.runs]
    fed = late_day.search.on(dataclasses.replace(late_day.search.day, runs=runs))
    assert change_beliefs(fed, late_day.ranked, [], {}, PRIORS) == {}
    answer = dataclasses.replace(late_day.answer, details=late_day.answer.details | {"beliefs": {}})
    with pytest.raises(UnplannableError, match="late: "):
        beliefs_of(answer)
