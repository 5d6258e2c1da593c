"""When a change is diagnosed while it is watched, and how the answer becomes an event."""

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
import pytest

from drift_drake.car.log.table import Run, write_run
from drift_drake.common.errors import DriftDrakeError
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.estimation.prior import Interval
from drift_drake.gap.monitoring.events import nothing_seen, sentence
from drift_drake.gap.monitoring.watch import VerdictAt
from drift_drake.gap.watching.diagnosed import Event, diagnosed_cause, diagnosing, with_diagnoses
from drift_drake.gap.watching.follow import Tail

LATE = {"steering_delay": 0.5, "sensor_latency": 0.3, "steering_delay+unknown": 0.1, "sensor_latency+unknown": 0.06}
ANSWER = Answer(
    "case", "effect", ["steering_delay"], LATE | {"none": 0.04}, [], {"steering_delay": Interval(0.08, 0.06, 0.1)}, {},
    Interval(0.9, 0.8, 1.0), 1.0, {}, {}, [],
)  # fmt: skip


def verdicts(end: float, **events: Event) -> Iterator[VerdictAt]:
    """One a second until `end`; events by the second, as `at_3`."""
    for t in np.arange(end + 1.0):
        said = [event for name, event in events.items() if name == f"at_{t:.0f}"]
        yield VerdictAt(float(t), np.zeros(5), said, nothing_seen(1))


def asked(end: float, answer: Answer | None = ANSWER, **events: Event) -> tuple[list[tuple[float, float]], list[Event]]:
    """(from when to when [s] a diagnosis was asked for, the events)."""
    spans = list[tuple[float, float]]()

    def diagnosed(begin: float, until: float) -> Answer | None:
        spans.append((begin, until))
        return answer

    said = [event for now in with_diagnoses(verdicts(end, **events), diagnosed) for event in now.events]
    return spans, said


CHANGE: Event = {"t": 3.0, "event": "change", "cause": "unknown", "onset": 2.0}


def test_rows_are_diagnosed_when_enough_then_at_twice_as_many_and_at_the_end() -> None:
    spans, said = asked(24.0, at_3=CHANGE)
    assert spans == [(2.0, 8.0), (2.0, 14.0), (2.0, 24.0)]
    assert [event["t"] for event in said] == [3.0, 8.0, 14.0, 24.0]
    assert asked(14.0, at_3=CHANGE)[0] == [(2.0, 8.0), (2.0, 14.0)]  # not twice at the end


def test_a_log_that_ends_soon_is_diagnosed_at_its_end_and_one_without_a_change_is_not() -> None:
    assert asked(6.0, at_3=CHANGE)[0] == [(2.0, 6.0)]
    assert asked(24.0) == ([], [])


def test_a_change_that_is_over_is_diagnosed_and_forgotten() -> None:
    spans, said = asked(24.0, at_3=CHANGE, at_7={"event": "over", "t": 7.0})
    assert spans == [(2.0, 7.0)]
    assert [event["event"] for event in said] == ["change", "cause", "over"]
    assert asked(5.0, at_3={"event": "over", "t": 3.0})[0] == []


def test_the_latest_onset_that_leaves_rows_enough_is_believed() -> None:
    later: Event = {"t": 6.0, "event": "cause", "cause": "steering_lag", "onset": 5.0}
    earlier: Event = {"t": 6.0, "event": "cause", "cause": "steering_lag", "onset": 1.0}
    assert asked(13.0, at_3=CHANGE, at_6=later)[0] == [(2.0, 8.0), (5.0, 13.0)]
    assert asked(13.0, at_3=CHANGE, at_6=earlier)[0] == [(2.0, 8.0), (2.0, 13.0)]


@pytest.mark.parametrize("answer", [None, dataclasses.replace(ANSWER, verdict="none", causes=[])])
def test_what_cannot_be_diagnosed_or_shows_nothing_leaves_the_monitors_cause(answer: Answer | None) -> None:
    assert asked(10.0, answer, at_3=CHANGE)[1] == [CHANGE]


def test_an_answer_is_an_event_with_rivals_by_the_effects_names() -> None:
    event = diagnosed_cause(ANSWER, 2.0, 10.0)
    assert event == {
        "t": 10.0, "event": "cause", "diagnosed": 8.0, "cause": "steering_delay", "probability": 0.6, "none": 0.04,
        "onset": 2.0, "rivals": {"sensor_latency": pytest.approx(0.36)}, "magnitude": 0.08, "low": 0.06, "high": 0.1,
        "unit": "s",
    }  # fmt: skip
    assert sentence(event) == (
        "10.0 s: steering_delay +0.08 s (95 %: 0.06 to 0.1), probability 0.60 (sensor_latency 0.36), since 2.0 s, by a "
        "diagnosis of these 8.0 s"
    )


def test_two_causes_an_additional_fault_and_unknown_are_said() -> None:
    two = dataclasses.replace(
        ANSWER, causes=["torque_lag", "gyro_bias"], posterior={"gyro_bias+torque_lag": 0.2,
        "gyro_bias+torque_lag+unknown": 0.79, "none": 0.01},
        magnitudes={"torque_lag": Interval(0.2, 0.1, 0.3), "gyro_bias": Interval(0.02, 0.01, 0.03)},
    )  # fmt: skip
    event = diagnosed_cause(two, 2.0, 10.0)
    assert (event["cause"], event["with"], event["magnitude"]) == ("torque_lag", ["gyro_bias", "unknown"], 0.2)
    assert event["probability"] == pytest.approx(0.99)
    assert "rivals" not in event
    assert "and gyro_bias and an additional fault, probability 0.99" in sentence(event)
    unknown = dataclasses.replace(ANSWER, verdict="unknown", causes=[], posterior={"unknown": 0.95, "none": 0.05})
    event = diagnosed_cause(unknown, 2.0, 10.0)
    assert (event["cause"], event["probability"]) == ("unknown", 0.95)
    assert not {"with", "magnitude"} & set(event)
    assert not any(isinstance(value, float) and math.isnan(value) for value in event.values())
    assert "unknown cause, probability 0.95" in sentence(event)


def test_too_few_rows_and_those_of_a_replaced_log_are_no_error(changed_run: Run, tmp_path) -> None:
    write_run(changed_run, tmp_path / "run_0.csv")
    for log in (changed_run, tmp_path / "run_0.csv"):
        assert diagnosing(log, "no file is read", None)(2.0, 2.005) is None
    tail = Tail(tmp_path / "run_0.csv", 0.0)
    with pytest.raises(DriftDrakeError, match="no file is read"):
        diagnosing(tail.path, "no file is read", None, tail)(0.0, 5.0)
    tail.ended = "has been replaced"
    assert diagnosing(tail.path, "no file is read", None, tail)(0.0, 5.0) is None
    assert diagnosing(tmp_path / "gone.csv", "no file is read", None)(2.0, 4.0) is None
