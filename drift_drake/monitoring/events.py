"""What is reported of a monitor's verdicts: a change, its cause once it is known, and its end."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from drift_drake.diagnosis.shared.posterior import UNKNOWN
from drift_drake.errors import unit_suffix
from drift_drake.monitoring.evidence import ALARM, NAMED, TRUSTED
from drift_drake.monitoring.monitor import Monitor
from drift_drake.vehicle.catalogue import CATALOGUE

PERSISTS, UNKNOWN_PERSISTS = 5, 20  # verdicts in a row that a cause must lead with it: right after a change few fit


@dataclasses.dataclass(frozen=True)
class Events:
    """What has been reported: whether there is a change, and which cause; and what is about to be."""

    changed: bool = False
    cause: str | None = None
    candidate: str | None = None
    count: int = 0  # verdicts in a row that name the candidate

    def after(self, monitor: Monitor, verdict: np.ndarray, t: float) -> tuple["Events", list[dict[str, Any]]]:
        """What has been reported after a verdict (`monitor.State`) at t [s], and what it adds, as plain data."""
        p, new = verdict[:-4], list[dict[str, Any]]()
        now = self
        if now.changed and p[0] >= TRUSTED:
            now, new = Events(), [{"t": t, "event": "over"}]
        if not now.changed and p[0] < ALARM:
            now = Events(True)
            new.append({"t": t, "event": "change"} | details(monitor, verdict))
        if now.changed:
            leading = 1 + int(np.argmax(p[1:]))
            name = monitor.labels[leading]
            sure = p[leading] >= NAMED
            now = Events(True, now.cause, name if sure else None, now.count * (name == now.candidate) + sure)
            if now.count >= (UNKNOWN_PERSISTS if name == UNKNOWN else PERSISTS) and name != now.cause:
                now = dataclasses.replace(now, cause=name)
                new.append({"t": t, "event": "cause"} | details(monitor, verdict))
        return now, [{key: _rounded(value) for key, value in event.items()} for event in new]


def details(monitor: Monitor, verdict: np.ndarray) -> dict[str, Any]:
    """The leading hypothesis that is not none: probability, magnitude, onset."""
    p = verdict[:-4]
    leading = 1 + int(np.argmax(p[1:]))
    name, (q, low, high, onset) = monitor.labels[leading], verdict[-4:]
    out = {"cause": name, "probability": p[leading], "none": p[0], "onset": onset}
    if name == UNKNOWN:
        return out
    return out | {"magnitude": q, "low": low, "high": high, "unit": CATALOGUE[name].unit}


def sentence(event: Mapping[str, Any]) -> str:
    """An event in words."""
    t = f"{event['t']:.1f} s:"
    if event["event"] == "over":
        return f"{t} the car agrees with the simulator again"
    since = f"since {event['onset']:.1f} s"
    if event["event"] == "change":
        return f"{t} the car has changed {since}; the simulator is not valid for it ({_cause(event)})"
    others = f"; or {', '.join(event['or'])}, which would look alike" if event.get("or") else ""
    return f"{t} {_cause(event)}, {since}{others}"


def _cause(event: Mapping[str, Any]) -> str:
    if event["cause"] == UNKNOWN:
        return f"unknown cause, probability {event['probability']:.2f}"
    interval = f"95 %: {event['low']:.3g} to {event['high']:.3g}"
    unit = unit_suffix(event["unit"])
    return f"{event['cause']} {event['magnitude']:+.3g}{unit} ({interval}), probability {event['probability']:.2f}"


def _rounded(value: Any) -> Any:
    return float(f"{value:.6g}") if isinstance(value, float) else value
