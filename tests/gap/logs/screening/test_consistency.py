"""Columns that say the same are held against each other: each mistake gets one sentence, a good log none."""

import dataclasses

import numpy as np
import pytest
from kinematic_log import LENGTH, NOISE, kinematic_log
from scipy.signal import butter, filtfilt

from drift_drake.car.log.table import COLUMNS, Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.logs.screening.consistency import consistency, consistency_of
from drift_drake.gap.logs.screening.overlays import estimates
from experiments.benchmarks.log_mutations import held, mapped_wrongly, measured_at, with_factors

CAR = dataclasses.replace(VehicleParameters(), front_axle_distance=1.2, rear_axle_distance=LENGTH - 1.2)
MOTION = ("x", "y", "psi", "r", "v", "beta", "omega_r", "ax", "ay")


def said(*runs, car=CAR):
    """Sentences on runs, with a vehicle file's wheelbase but no torque."""
    return [doubt.sentence for doubt in consistency_of(runs, car).doubts]


@pytest.fixture(scope="module")
def log():
    return kinematic_log()


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("changes", [
    {}, {"noise": 0.0}, {"drifting": 0.6}, {"size": 0.1, "drifting": 0.5}, {"noise": 4.0}, {"seconds": 9.0},
    {"speed": 30.0},
])  # fmt: skip
def test_a_good_log_gets_no_sentence(changes, seed):
    size = changes.get("size", 1.0)
    car = dataclasses.replace(CAR, front_axle_distance=1.2 * size, rear_axle_distance=(LENGTH - 1.2) * size)
    run = kinematic_log(seed=seed, **changes)
    assert said(run, car=car) == []
    assert said(run.without("beta"), car=None) == []
    assert said(run.without("x", "y", "psi"), car=car) == []


def test_a_speed_that_never_changes_is_no_measured_one(log):
    constant = dataclasses.replace(log, v=np.full(len(log.t), 14.0)).without("x", "y", "omega_r", "ax", "ay", "beta")
    (sentence,) = said(constant)
    assert sentence.startswith("column v is 14 m/s in all rows: a set speed")


def test_short_logs_say_how_closely_they_tell_a_scale():
    short, long = (consistency_of([kinematic_log(seconds)], CAR).undecided for seconds in (5.0, 60.0))
    assert "whether the scale of r and v is right within a factor of 2" in short
    assert not any("scale" in clause for clause in long)
    log = kinematic_log(11.0).without("x", "y", "psi", "beta", "omega_r")
    assert said(log) == []
    assert any("30 % too large" in one or "31 % too large" in one for one in said(*with_factors([log], {"v": 1.3})))


@pytest.mark.parametrize("seed", [3, pytest.param(4, marks=pytest.mark.slow)])
def test_smoothed_signals_get_no_sentence(seed):
    b, a = butter(2, 8.0 / 50.0)
    run = kinematic_log(seed=seed, drifting=0.4)
    assert said(dataclasses.replace(run, **{name: filtfilt(b, a, run.column(name)) for name in MOTION})) == []


@pytest.mark.parametrize("column", ["r", "psi", "v", "ax", "ay", "omega_r"])
@pytest.mark.parametrize(("factor", "drifting"), [(1.07, 0.0), (0.93, 0.4)])
def test_seven_per_cent_are_named_with_the_column(column, factor, drifting):
    log = kinematic_log(60.0, drifting=drifting)
    (doubt,) = consistency_of(with_factors([log], {column: factor}), CAR).doubts
    assert doubt.column == column or f"or {column} " in doubt.sentence
    assert "% too" in doubt.sentence
    assert "mapping" in doubt.sentence
    if doubt.column == column:
        assert doubt.factor == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize(
    ("lacking", "column"),
    [(("x", "y"), "psi"), (("psi",), "r"), (("beta",), "ay"), (MOTION[:3], "ay"), (("x", "y", "omega_r"), "v")],
)
def test_fewer_columns_tell_too(log, lacking, column):
    reported = said(*with_factors([log.without(*lacking)], {column: 1.1}))
    assert len(reported) == 1
    assert column in reported[0]


def test_a_column_that_explains_most_is_named_and_the_rest_left_out(log):
    """Speed is in four relations: one sentence, with all of them as its evidence."""
    (sentence,) = said(*with_factors([log], {"v": 1.1}))
    assert sentence.startswith("column v reads 10 % too large (")
    for evidence in ("ay over", "ax over", "the speed along x, y", "omega_r over v"):
        assert evidence in sentence


def test_a_yaw_rate_that_is_not_zero_on_the_straight(log):
    biased = dataclasses.replace(log, r=log.r + 0.03)
    for run in (biased, biased.without("psi")):
        (sentence,) = said(run)
        assert "column r reads +0.0" in sentence
        assert "offset -0.0" in sentence
    assert "0.03" in sentence


@pytest.mark.parametrize(("ahead", "left"), [(0.0, 0.5), (0.0, -0.6), (1.2, 0.0)])
def test_a_point_of_measurement_away_from_the_centre(ahead, left):
    log = kinematic_log(60.0)
    (sentence,) = said(measured_at(log, ahead, left))
    assert "add measured_point: [" in sentence
    point = [float(q) for q in sentence.split("[")[1].split("]")[0].split(",")]
    assert point == pytest.approx([ahead, left], abs=0.15)


def test_gentle_driving_tells_the_ratio_and_the_point():
    log = measured_at(kinematic_log(60.0), 1.2, 0.5)
    columns = {name: log.column(name) for name in ("r", "v", "beta", "omega_r", "ax", "ay", "psi", "x", "y")}
    found = estimates([columns | {"delta_cmd": 15.0 * log.delta_cmd}], log.period, LENGTH)
    assert found.ahead.middle == pytest.approx(1.2, abs=0.15)
    assert found.left.middle == pytest.approx(0.5, abs=0.15)
    assert found.steering.middle == pytest.approx(15.0, rel=0.03)
    assert estimates([columns | {"delta_cmd": log.delta_cmd}], log.period).steering is None  # no wheelbase


def test_without_accelerations_the_wheels_tell_it(log):
    (sentence,) = said(measured_at(log, 0.0, 0.5).without("ax", "ay", "x", "y"))
    assert "v less omega_r against r" in sentence
    assert float(sentence.split("measured ")[1].split(" m ")[0]) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("ratio", [1.25, 0.8, 14.0])
def test_a_steering_ratio_is_distinguished_from_understeer(log, ratio):
    (doubt,) = consistency_of(with_factors([log], {"delta_cmd": ratio}), CAR).doubts
    assert doubt.column == "delta_cmd"
    assert doubt.factor == pytest.approx(ratio, rel=0.03)
    understeering = dataclasses.replace(log, delta_cmd=log.delta_cmd + 0.004 * log.v * log.r)
    assert said(understeering) == []


def test_commands_that_are_held_and_too_large(log):
    assert any(
        "delta_cmd is held for 0.05 s each, 20 Hz in a log of 100 Hz" in text
        for text in said(held(log, "delta_cmd", 5))
    )
    assert said(held(log, "delta_cmd", 2)) == []
    in_steps = dataclasses.replace(log, delta_cmd=0.005 * np.round(log.delta_cmd / 0.005))
    assert said(in_steps) == []
    narrow = dataclasses.replace(CAR, steering_limit=0.5 * float(np.max(np.abs(log.delta_cmd))))
    assert any("beyond the steering_limit" in text for text in said(log, car=narrow))


@pytest.mark.parametrize("late", [0.4, -0.2])
def test_commands_on_another_clock(log, late):
    """A car's yaw rate comes after its steering, and not by half a second."""
    rows = round(late / 0.01)
    shifted = dataclasses.replace(log, delta_cmd=np.roll(log.delta_cmd, -rows)).rows(50, len(log) - 50)
    (sentence,) = said(shifted, car=None)
    assert ("commands lead the motion by" if late > 0.0 else "the motion leads its commands by") in sentence


KINDS = sorted(mapped_wrongly(kinematic_log(2.0)))


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("drifting", [0.0, pytest.param(0.3, marks=pytest.mark.slow)])
def test_a_column_that_is_not_what_it_is_called(name, drifting):
    run = mapped_wrongly(kinematic_log(drifting=drifting))[name]
    if "dead" in name or "at zero" in name:
        column = name.split()[0]
        assert said(run)[0].startswith(f"column {column} is dead: ")
        return
    (sentence,) = said(run)
    assert {"without": "it is a magnitude", "swapped": "look swapped", "roll": "it is no speed"}[
        next(word for word in ("without", "swapped", "roll") if word in name)
    ] in sentence
    assert name.split()[0] in sentence


@pytest.mark.parametrize("roll_rate", [False, True])
def test_a_car_that_stands_at_first_has_a_speed(log, roll_rate):
    """44 s at rest and 30 s of driving; a roll rate taken for the speed is doubted all the same."""
    run = mapped_wrongly(log)["v a roll rate"] if roll_rate else log
    rest, rng = 4400, np.random.default_rng(1)
    columns = {}
    for name in ("x", "y", "psi", "r", "v", "beta", "omega_r", "ax", "ay", "delta_cmd"):
        values = run.column(name)
        still = np.full(rest, values[0] if name in ("x", "y", "psi") else 0.0)
        columns[name] = np.concatenate([still + rng.normal(0.0, NOISE.get(name, 0.0), rest), values])
    stood = Run("run_0", 0.01 * np.arange(rest + len(run)), tau_cmd=None, **columns)
    doubts = [doubt.sentence for doubt in consistency_of([stood], CAR).doubts if "no speed" in doubt.sentence]
    assert len(doubts) == int(roll_rate)


def test_two_speeds_that_are_too_much_alike_are_named(log):
    """Whether they are exchanged or not."""
    assert consistency_of([kinematic_log(60.0, drifting=0.6)], CAR).undecided == ()
    rolling = dataclasses.replace(log, omega_r=log.v * (1.0 + 0.01 * np.sin(log.t)))
    for run in (rolling, dataclasses.replace(rolling, v=rolling.omega_r, omega_r=rolling.v)):
        found = consistency_of([run], CAR)
        assert found.doubts == []
        assert any(
            clause.startswith("whether v and omega_r are exchanged (they differ by 0.9") for clause in found.undecided
        )


def test_a_point_of_measurement_that_nothing_tells_is_named(log):
    alone = log.without("omega_r", "beta", "ax", "ay")
    assert consistency_of([alone], CAR).undecided == ("where on the car v is measured",)


def test_what_nothing_tells_is_named(log):
    alone = log.without("x", "y", "psi", "beta", "ax", "ay", "omega_r")
    found = consistency_of([alone], None)
    assert found.doubts == []
    assert "v" in found.unchecked
    assert consistency_of([log], None).unchecked == ()
    columns = {name: values for name in COLUMNS if (values := log.column(name)) is not None}
    made = {name: columns[name] for name in ("x", "y", "psi", "r", "v", "beta", "delta_cmd")}
    derived = consistency([made], [0.01], derived=("x", "y", "psi", "r", "v", "beta"))
    assert set(derived.unchecked) >= {"psi", "v", "beta"}
