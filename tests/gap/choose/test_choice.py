"""Which model is believed, by made-up findings: the order of the questions, what is usual, and what is said."""

import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t as student

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.manoeuvres.steering_check import Steering
from drift_drake.gap.choose import choice as module
from drift_drake.gap.choose.choice import (
    OTHER_SIZE,
    Choice,
    Familiar,
    Findings,
    ask,
    car_error,
    doubts,
    hybrid_limit,
    stored,
    usual_surprise,
)
from drift_drake.gap.choose.identified import BIASES, ONE_MORE, IdentifiedCar

CAR = VehicleParameters()
PLAIN, EARLY = IdentifiedCar(CAR, Effects()), IdentifiedCar(CAR, Effects(command_clock_error=0.05))


@pytest.mark.parametrize(
    ("found", "believed", "said"),
    [
        (Findings(PLAIN, 1.0), "identified", "drive with the identified car: half a second ahead"),
        (Findings(EARLY, 1.0), "adapting", "identified with command_clock_error 0.05"),
        (Findings(PLAIN, 1.01, surprise=2.0), "hybrid", "learn what it leaves over (HybridStepModel)"),
        (Findings(EARLY, 1.01, surprise=2.0), "hybrid", "HybridStepModel"),
        (Findings(PLAIN, 1.01, surprise=2.01), "adapting", "no model is known to hold for this car"),
        (Findings(PLAIN, 0.5, ("gentle", "small")), "adapting", "no model is believed on these drives: gentle; small"),
        (Findings(None), "adapting", "or gather more; no car was identified"),
    ],
)
def test_a_car_is_believed_up_to_what_is_usual(found: Findings, believed: str, said: str) -> None:
    choice = Choice(found, 1.0, 2.0)
    assert choice.believed == believed
    assert said in choice.sentence()


def test_nothing_is_left_to_a_hybrid_model_that_nobody_has_asked() -> None:
    assert Choice(Findings(PLAIN, 1.01, surprise=1e-9), 1.0).believed == "adapting"


def test_a_sentence_has_the_error_the_limit_and_the_hint() -> None:
    said = Choice(Findings(PLAIN, 1.5, hint="; 0.3 for another"), 1.0).sentence()
    assert said.endswith("off by 1.5 (as a rule at most 1; 0.3 for another)")


def test_a_limit_is_what_a_further_car_exceeds_with_the_given_probability() -> None:
    """Student's prediction interval of one more draw, of the logarithm."""
    usual = Familiar(math.log(0.02), 0.3, 12)
    for refused in (0.5, 0.1, 0.001):
        off = (math.log(usual.limit(refused)) - usual.mean) / (usual.deviation * math.sqrt(1.0 + 1.0 / 12))
        assert student(11).sf(off) == pytest.approx(refused, rel=1e-9)


def test_what_nobody_has_asked_is_not_usual(tmp_path: Path) -> None:
    known, other = SimpleNamespace(content_hash=lambda: "a"), SimpleNamespace(content_hash=lambda: "b")
    file = tmp_path / "usual.json"
    assert usual_surprise(known, file) is None
    assert stored(file) == {"identified": {}, "surprise": {}}
    file.write_text(json.dumps({"surprise": {"a": {"mean": 1.0, "deviation": 0.5, "vehicles": 9}}}))
    assert usual_surprise(known, file) == Familiar(1.0, 0.5, 9)
    assert usual_surprise(other, file) is None
    assert hybrid_limit(other) == 0.0


def run_of(r: float, v: float = 12.0) -> Run:
    t = 0.01 * np.arange(300)
    return Run("run_0", t, np.full(300, r), np.full(300, v), np.zeros(300), tau_cmd=np.zeros(300))


def test_gentle_drives_and_other_sizes_are_doubted(monkeypatch: pytest.MonkeyPatch) -> None:
    """As lively as the grip at least one drive must be; half again as long is another size, and so is a model car."""
    monkeypatch.setattr(module, "suspicions", lambda *_: [])
    lively = CAR.friction * CAR.gravity / 12.0
    assert doubts([run_of(0.5 * lively), run_of(1.01 * lively)], CAR) == ()
    (gentle,) = doubts([run_of(0.5 * lively), run_of(0.99 * lively)], CAR)
    assert "too gentle" in gentle
    for size, doubtful in ((0.99, False), (1.01, True)):
        for factor in (OTHER_SIZE * size, 1.0 / (OTHER_SIZE * size)):
            car = CAR.replace(front_axle_distance=factor * CAR.front_axle_distance,
                              rear_axle_distance=factor * CAR.rear_axle_distance)  # fmt: skip
            assert any("the wheelbase is" in doubt for doubt in doubts([run_of(2.0 * lively)], car)) == doubtful
    said = [SimpleNamespace(sentence="odd", column="v"), SimpleNamespace(sentence="only odd", column=None)]
    monkeypatch.setattr(module, "suspicions", lambda *_: said)
    assert doubts([run_of(2.0 * lively)], CAR) == ("odd",)


def test_no_car_is_infinitely_far_off() -> None:
    assert car_error(None, []) == math.inf


class Asked:
    """`ask` of drives whose cars are off by as much as is given, by name; no other work is done."""

    def __init__(self, patch: pytest.MonkeyPatch, errors: dict[str, float]) -> None:
        self.errors, self.fitted, self.shares = errors, [], []
        patch.setattr(module, "doubts", lambda *_: ())
        patch.setattr(module, "asked_parts", lambda runs, _: (runs, ["parts"]))
        patch.setattr(module, "windowed", lambda run: run)
        patch.setattr(module, "usual_error", lambda: SimpleNamespace(limit=lambda: 1.0))
        patch.setattr(module, "car_error", lambda car, _: math.inf if car is None else self.errors[car.name])
        patch.setattr(module, "identified", self.one_track)
        patch.setattr(module, "identified_with_own_states", self.two_tracks)
        patch.setattr(module, "load_hybrid", lambda: "hybrid")
        patch.setattr(module, "hybrid_limit", lambda _: 7.0)
        patch.setattr(module, "surprise_of", lambda *_: 3.0)

    def found(self, name: str) -> SimpleNamespace | None:
        self.fitted.append(name)
        if name not in self.errors:
            return None
        car = SimpleNamespace(name=name, beyond=())
        car.with_limit = lambda rate: SimpleNamespace(name=name, beyond=(), rate=rate)
        return car

    def one_track(self, _runs, _first_guess, more=(), start=Effects()) -> SimpleNamespace | None:
        self.start = start
        return self.found("+".join(("one", *more)))

    def two_tracks(self, _judged, _first_guess, more=(), near=None) -> tuple[SimpleNamespace, str] | None:
        assert near == ("near" if more and "two" in self.errors else None)  # where the one before has come to
        car = self.found("two off" if more == BIASES else "two")
        return car and (car, "near")

    def ask(self, steering: Steering | None = None) -> Choice:
        given = () if steering is None else (steering,)
        return ask([run_of(1.0)], CAR, lambda _, share: self.shares.append(share), *given)


def test_a_car_as_good_as_usual_is_taken_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = Asked(monkeypatch, {"one": 1.0})
    choice = asked.ask()
    assert asked.fitted == ["one"]
    assert choice.found.car.name == "one"
    assert (choice.found.error, choice.found.as_it_is, choice.limit, choice.remarks) == (1.0, 1.0, 1.0, ("parts",))
    assert asked.shares == [0.0, 1.0]
    assert choice.believed == "identified"


def test_doubted_drives_are_asked_no_further(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = Asked(monkeypatch, {"one": 9.0})
    monkeypatch.setattr(module, "doubts", lambda *_: ("gentle",))
    assert asked.ask().believed == "adapting"
    assert asked.fitted == ["one"]


EACH = {f"one+{name}": 2.0 + i for i, name in enumerate(ONE_MORE)}


@pytest.mark.parametrize(
    ("errors", "fitted", "taken", "error", "hint"),
    [
        # One more effect explains it: the best of these.
        ({"one+" + ONE_MORE[2]: 0.9}, 0, "one+" + ONE_MORE[2], 0.9, ""),
        ({"one+" + ONE_MORE[1]: 1.0}, 0, "one+" + ONE_MORE[1], 1.0, ""),
        # A double-track car does.
        ({"two": 0.8}, 1, "two", 0.8, ""),
        # One with sensors that are off does, where that is far nearer; two unknowns more are nearer in any case.
        ({"two": 1.9, "two off": 0.9}, 2, "two off", 0.9, ""),
        ({"two": 1.9, "two off": 0.96}, 2, "one", 5.0, "; 1.9 for two"),
        # None does: the car as it is, and which would be far nearer.
        ({"two": 2.4, "two off": 2.0}, 2, "one", 5.0, "; 2 for one+" + ONE_MORE[0]),
        ({"two": 2.6} | dict.fromkeys(EACH, 2.6), 2, "one", 5.0, ""),
        ({}, 2, "one", 5.0, "; 2 for one+" + ONE_MORE[0]),
    ],
)
def test_another_car_is_taken_where_it_is_as_good_as_usual(
    monkeypatch: pytest.MonkeyPatch, errors: dict[str, float], fitted: int, taken: str, error: float, hint: str
) -> None:
    asked = Asked(monkeypatch, {"one": 5.0} | EACH | errors)
    choice = asked.ask()
    assert asked.fitted == ["one", *EACH, *["two", "two off"][:fitted]]
    assert (choice.found.car.name, choice.found.error, choice.found.hint) == (taken, error, hint)
    assert choice.found.as_it_is == 5.0
    # What it leaves over is asked of the single-track car alone, where that one is not near enough.
    assert (choice.found.surprise, choice.surprise_limit) == (3.0 if taken == "one" else math.inf, 7.0)
    assert choice.believed == ("hybrid" if taken == "one" else "identified")
    assert asked.shares == sorted(asked.shares)
    assert (asked.shares[0], asked.shares[-1]) == (0.0, 1.0)
    assert len(set(asked.shares)) == len(asked.shares)


def test_a_limit_of_the_steering_that_a_check_showed_is_the_cars(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = Asked(monkeypatch, {"one": 0.5})
    shown = Steering(lag=0.3, rate=0.7)
    choice = asked.ask(shown)
    assert choice.found.car.rate == 0.7
    assert asked.start == shown.effects


def test_without_any_car_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    choice = Asked(monkeypatch, {}).ask()
    assert choice.found.car is None
    assert choice.found.error == choice.found.surprise == math.inf
    assert choice.believed == "adapting"
    assert choice.beyond == ()
