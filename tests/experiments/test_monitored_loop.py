"""The closed loop with and without the monitor: which drives a policy saves, and which it loses."""

from pathlib import Path

import numpy as np
import pytest

from experiments.monitoring.closed_loop import PATCH, pairs
from experiments.monitoring.foreign_loop import ONSETS, Vehicle
from experiments.other_worlds.changing_car import ChangingCar


def result(mode: str, seed: int, completed: bool) -> dict[str, object]:
    outcome = {"outcome": "completed" if completed else "spin"}
    return {"plant": "nominal", "change": "friction drop", "mode": mode, "seed": seed, "metrics": outcome}


def test_drives_are_compared_with_the_same_ones_without_the_monitor() -> None:
    without = [result("off", seed, done) for seed, done in enumerate([False, False, True])]
    slow = [result("slow", seed, done) for seed, done in enumerate([True, False, False])]
    assert pairs([*without, *slow, result("slow", 3, True)]) == (
        "nominal, slow: of 2 drives lost without it 1 are completed, of 1 completed without it 1 are lost"
    )


def test_a_car_of_another_program_changes_as_the_catalogue_says() -> None:
    pytest.importorskip("mujoco", reason="an extra: worlds")
    vehicle = Vehicle("mujoco", 0, 5, Path())
    begin = vehicle.onset()
    assert ONSETS[0] <= begin <= ONSETS[1]
    for change, (end, torque, rate) in {
        "friction drop": (np.inf, 1.0, np.inf), "friction patch": (begin + PATCH, 1.0, np.inf),
        "steering rate limit": (np.inf, 1.0, 0.45), "torque loss": (np.inf, pytest.approx(0.2), np.inf),
    }.items():  # fmt: skip
        car, faults = vehicle.changing(change)
        assert isinstance(car, ChangingCar)
        assert (car.begin, car.end, car.torque, car.steering_rate) == (begin, end, torque, rate)
        assert not faults
    _, faults = vehicle.changing("sideslip sensor")
    assert [(fault.kind, fault.start, fault.channel) for fault in faults] == [
        ("bias", begin, "beta"), ("bias", begin, "dphi")
    ]  # fmt: skip
