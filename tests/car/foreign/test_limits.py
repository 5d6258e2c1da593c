"""A limit on a roll-out's time, whatever the simulator does with the exception."""

import time

import pytest

from drift_drake.car.foreign.rollouts import at_most


def test_a_limit_that_is_caught_strikes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drift_drake.car.foreign.rollouts.AGAIN", 0.1)

    def stubborn() -> None:
        try:
            time.sleep(30.0)
        except TimeoutError:
            time.sleep(30.0)

    begun = time.monotonic()
    with pytest.raises(TimeoutError, match=r"a roll-out took longer than 0\.1 s"), at_most(0.1):
        stubborn()
    assert time.monotonic() - begun < 20.0


def test_no_limit_strikes_after_the_block() -> None:
    with at_most(0.05):
        pass
    time.sleep(0.2)
