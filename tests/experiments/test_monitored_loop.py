"""The closed loop with and without the monitor: which drives a policy saves, and which it loses."""

from experiments.monitoring.closed_loop import pairs


def result(mode: str, seed: int, completed: bool) -> dict[str, object]:
    outcome = {"outcome": "completed" if completed else "spin"}
    return {"plant": "nominal", "change": "friction drop", "mode": mode, "seed": seed, "metrics": outcome}


def test_drives_are_compared_with_the_same_ones_without_the_monitor() -> None:
    without = [result("off", seed, done) for seed, done in enumerate([False, False, True])]
    slow = [result("slow", seed, done) for seed, done in enumerate([True, False, False])]
    assert pairs([*without, *slow, result("slow", 3, True)]) == (
        "nominal, slow: of 2 drives lost without it 1 are completed, of 1 completed without it 1 are lost"
    )
