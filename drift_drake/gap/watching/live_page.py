"""A page that shows what the monitor says, while it says it: one file without a server, which loads itself anew."""

import dataclasses
import math
import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from drift_drake.common.safe_files import write_text
from drift_drake.gap.evidence.posterior import UNKNOWN
from drift_drake.gap.monitoring.events import SIGNALS, sentence
from drift_drake.gap.monitoring.watch import VerdictAt
from drift_drake.view.pages.policy import with_policy
from drift_drake.view.pages.templates import templates

TEMPLATE = Path(__file__).with_name("live_page.html")
LONGEST = 3000  # verdicts that are shown, 300 s
POINTS = 400  # of a band, at most
LEADING = 4  # causes with a band of their own
EVENTS = 30  # that are listed
TICKS = 5  # of the time axis
EACH = 1.0  # [s] between two writings, at least
NONE_COLOUR, OTHER_COLOUR, UNKNOWN_COLOUR = "#009e73", "#bbbbbb", "#d55e00"
COLOURS = ("#0072b2", "#e69f00", "#cc79a7", "#56b4e9")

UNITS = {"r": "rad/s", "v": "m/s", "beta": "rad", "omega_r": "m/s"}


@dataclasses.dataclass(frozen=True)
class SignalLines:
    """One signal of the page."""

    name: str
    unit: str
    low: float
    high: float
    middle: float  # to a thousandth of what lies between them
    measured: str  # points of SVG lines
    predicted: str


@dataclasses.dataclass(frozen=True)
class Band:
    """One colour of the chart."""

    name: str
    colour: str
    points: str  # of an SVG polygon
    last: float  # probability now


def shown_while(
    verdicts: Iterable[VerdictAt], path: Path, name: str, labels: Sequence[str], live: bool
) -> Iterator[VerdictAt]:
    """Hands verdicts (`watch.watched`) on and keeps a page of them: `live`, at most once a second; else at the end.

    Raises:
        OutputError: the page cannot be written.
    """
    kept: deque[VerdictAt] = deque(maxlen=LONGEST)
    events, written = list[dict[str, Any]](), -np.inf
    try:
        for judged in verdicts:
            kept.append(judged)
            events += judged.events
            if live and time.monotonic() - written >= EACH:
                write_text(path, page(name, labels, kept, events, live))
                written = time.monotonic()
            yield judged
    finally:  # a watch that is broken off leaves no page that still waits for it
        write_text(path, page(name, labels, kept, events, False))


def page(
    name: str, labels: Sequence[str], verdicts: Sequence[VerdictAt] | deque[VerdictAt],
    events: Sequence[Mapping[str, Any]], live: bool,
) -> str:  # fmt: skip
    """The page's HTML of verdicts, their probabilities in the order of `labels`."""
    every = max(len(verdicts) // POINTS, 1)
    rows = list(verdicts)[::-1][::every][::-1]  # the newest stays
    t = np.array([row.t for row in rows])
    p = np.array([row.verdict[: len(labels)] for row in rows]).reshape(len(t), len(labels))
    start, end = (float(t[0]), float(t[-1])) if len(t) else (0.0, 0.0)
    x = np.zeros(len(t)) if end == start else (t - start) / (end - start) * len(t)
    marks = [(event["t"] - start) / (end - start) * len(t) for event in events if end > start and event["t"] >= start]
    last = events[-1] if events else None
    of_a_change = [event["event"] for event in events if event["event"] in ("change", "cause", "over")]
    changed = bool(of_a_change) and of_a_change[-1] != "over"
    now = sentence(last) if last is not None else f"{end:.1f} s: nothing has changed"
    html = templates(TEMPLATE.parent).get_template(TEMPLATE.name).render(
        name=name, live=live, now=now, changed=changed, width=max(len(t), 1), bands=bands(labels, x, p),
        traces=traces(x, np.array([row.seen.signals for row in rows]).reshape(len(t), 2, len(SIGNALS))),
        times=np.linspace(start, end, TICKS), marks=[f"{mark:.2f}" for mark in marks],
        events=[sentence(event) for event in events[-EVENTS:]], written=time.time(),
        clock=time.strftime("%Y-%m-%d %H:%M:%S"),
    )  # fmt: skip
    return with_policy(html)


def traces(x: np.ndarray, signals: np.ndarray) -> list[SignalLines]:
    """Signals as measured and as predicted [n, 2, SIGNALS] at x [n]."""
    out = list[SignalLines]()
    for i, name in enumerate(SIGNALS):
        values = signals[:, :, i]
        known = np.isfinite(values).all(axis=1)
        if not known.any():
            continue
        low, high = float(values[known].min()), float(values[known].max())
        span = max(high - low, 1e-9)
        y = 100.0 * (high - values[known]) / span
        middle = round(0.5 * (high + low), 3 - math.ceil(math.log10(span)))
        lines = [" ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x[known], y[:, k], strict=True)) for k in range(2)]
        out.append(SignalLines(name, UNITS[name], low, high, middle, *lines))
    return out


def bands(labels: Sequence[str], x: np.ndarray, p: np.ndarray) -> list[Band]:
    """Probabilities [n, labels] at x [n], stacked from the bottom up: none, leading causes, the others, unknown."""
    if not len(p):
        return []
    causes = [i for i in range(1, len(labels)) if labels[i] != UNKNOWN]
    leading = sorted(causes, key=lambda i: -p[:, i].max())[:LEADING]
    others = [i for i in causes if i not in leading]
    groups = [("none", NONE_COLOUR, [0]), *((labels[i], c, [i]) for i, c in zip(leading, COLOURS, strict=False)),
              ("others", OTHER_COLOUR, others), (UNKNOWN, UNKNOWN_COLOUR, [labels.index(UNKNOWN)])]  # fmt: skip
    out, low = list[Band](), np.zeros(len(x))
    for name, colour, members in groups:
        high = low + p[:, members].sum(axis=1)
        outline = [
            *zip(x, 100.0 * np.maximum(1.0 - high, 0.0), strict=True),
            *zip(x[::-1], 100.0 * (1.0 - low[::-1]), strict=True),
        ]
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in outline)
        out.append(Band(name, colour, points, float(p[-1, members].sum())))
        low = high
    return out
