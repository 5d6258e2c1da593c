"""What is reported, from verdicts that are made up: a cause that later rows refute does not stay the last one."""

import numpy as np

from drift_drake.gap.monitoring.events import Events


def test_a_refuted_cause_is_followed_by_what_leads_with_its_rivals(monitor) -> None:
    def verdict(**p: float) -> np.ndarray:
        return np.array([*(p.get(name, 0.0) for name in monitor.labels), 0.1, 0.05, 0.15, 1.0])

    soon = verdict(none=0.001, friction_level=0.999)
    later = verdict(steering_delay=0.5, steering_lag=0.3, sensor_latency=0.2)
    said, reported = Events(), []
    for i, now in enumerate([soon] * 8 + [later] * 8 + [verdict(steering_delay=0.9, steering_lag=0.1)] * 8):
        said, new = said.after(monitor, now, 0.1 * i)
        reported += new
    assert [event["event"] for event in reported] == ["change", "cause", "cause", "cause"]
    assert [event["cause"] for event in reported] == [
        "friction_level",
        "friction_level",
        "steering_delay",
        "steering_delay",
    ]
    assert set(reported[2]["rivals"]) == {"steering_lag", "sensor_latency"}
