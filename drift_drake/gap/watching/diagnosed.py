"""The cause of a change, from a diagnosis of the rows since it began.

The monitor compares a change with cars of fixed magnitudes, to first order, within its period. A diagnosis of the same
rows fits each cause's magnitude and simulates it; it takes seconds. So it is made when there are rows enough (`FIRST`),
each time there are twice as many, and where the change or the log ends.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from drift_drake.car.given_vehicle import Vehicle
from drift_drake.car.log.table import InvalidLogError, Run, read_run
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.answers.rivals import TOO, of_rivals
from drift_drake.gap.evidence.posterior import NONE, UNKNOWN
from drift_drake.gap.monitoring.events import cause_of, rounded
from drift_drake.gap.monitoring.watch import VerdictAt
from drift_drake.gap.watching.follow import Tail

FIRST = 6.0  # [s] since the change
Event = dict[str, Any]
Diagnosing = Callable[[float, float], Answer | None]
"""The answer of the rows from t to t [s]; None where it cannot be had."""


def with_diagnoses(verdicts: Iterator[VerdictAt], diagnosed: Diagnosing) -> Iterator[VerdictAt]:
    """Verdicts, some of them with one more event: the cause that the rows since the change show."""
    onsets, asked, last = list[float](), 0.0, None

    def event_at(t: float) -> list[Event]:
        since = begins(onsets, t)
        answer = diagnosed(since, t)
        return [] if answer is None or answer.verdict == NONE else [diagnosed_cause(answer, since, t)]

    for now in verdicts:
        last = now
        for event in now.events:
            if onsets and event["event"] == "over":
                now = now._replace(events=[*event_at(now.t), *now.events])
                onsets, asked = [], 0.0
            onsets += [event["onset"]] if "onset" in event else []
        if onsets and now.t - onsets[0] >= max(FIRST, 2.0 * asked):
            asked = now.t - onsets[0]
            now = now._replace(events=[*now.events, *event_at(now.t)])
        yield now
    if last is not None and onsets and last.t - onsets[0] > asked:
        yield last._replace(events=event_at(last.t))


def begins(onsets: Sequence[float], t: float) -> float:
    """The latest of the onsets [s] of one change that leaves rows enough until t, or the earliest.

    Rows before the change look like a fault that acts now and then; those that are left out after it cost less.
    """
    return max((onset for onset in onsets if t - onset >= FIRST), default=min(onsets))


def diagnosed_cause(answer: Answer, onset: float, t: float) -> Event:
    """A diagnosis of the rows from an onset until t [s], as an event that names the cause."""
    hypothesis = "+".join(sorted(answer.causes)) or UNKNOWN
    alone, too = (answer.posterior.get(name, 0.0) for name in (hypothesis, hypothesis + TOO))
    others = {name.removesuffix(TOO): p for name, p in of_rivals(answer.posterior, hypothesis).items()}
    magnitude = next(((m.estimate, m.low, m.high) for m in map(answer.magnitudes.get, answer.causes) if m), ())
    event = {"t": t, "event": "cause", "diagnosed": t - onset} | cause_of(
        (*answer.causes, UNKNOWN)[0], alone + too, others.pop(NONE, 0.0), onset, others, magnitude,
    )  # fmt: skip
    also = [*answer.causes[1:], *([UNKNOWN] if answer.causes and too > alone else [])]
    return {key: rounded(value) for key, value in event.items()} | ({"with": also} if also else {})


def diagnosing(log: str | Path | Run, vehicle: Vehicle, calibration: Any, tail: Tail | None = None) -> Diagnosing:
    """Diagnoses rows of a log, of a car that was calibrated; the arguments are those of `watch`.

    Args:
        tail: of a log that is followed: once it was cut or replaced, its file holds other rows, and none is diagnosed.
    """

    def diagnosed(begin: float, end: float) -> Answer | None:
        from drift_drake.gap.diagnosis.diagnose import diagnose  # slow to import

        if tail is not None and tail.ended:
            return None
        try:
            run = log if isinstance(log, Run) else read_run(Path(log))
            first, last = np.searchsorted(run.t, [begin, end + 0.5 * run.period])
            return diagnose([run.rows(int(first), int(last))], vehicle, calibration).answer
        except InvalidLogError:  # too few rows, or one that is still being written
            return None

    return diagnosed
