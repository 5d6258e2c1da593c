"""What is left of runs: spins, reversing, standstill and frozen rows cut out, with their times and what is enough."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.log.driving import driven, reversing, slowest_asked
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.usable import admit, least_part, usable_parts
from drift_drake.gap.logs.screening.screened import screened
from drift_drake.gap.logs.screening.suspicions import suspicions

CAR = VehicleParameters()
SMALL = CAR.replace(front_axle_distance=0.08, rear_axle_distance=0.09, mass=1.6)


def gentle(seconds=12.0, period=0.01, **changes):
    """A slalom as noisy sensors log it."""
    rng = np.random.default_rng(0)
    t = np.arange(round(seconds / period)) * period
    noise = rng.standard_normal((4, len(t)))
    columns = {
        "r": 0.3 * np.sin(2.0 * t) + 0.002 * noise[0],
        "v": 12.0 + 0.02 * noise[1],
        "beta": -0.02 * np.sin(2.0 * t) + 0.002 * noise[2],
        "omega_r": 12.1 + 0.04 * noise[3],
    }
    return Run(name="run_0", t=t, delta_cmd=0.06 * np.sin(2.0 * t), tau_cmd=30.0 + t, **(columns | changes))


def changed(run, column, start, stop, value):
    """The run with what the column's mean is moved to, its noise kept."""
    values = run.column(column).copy()
    values[start:stop] += value - np.mean(values[start:stop])
    return dataclasses.replace(run, **{column: values})


def usable(runs, car):
    """The parts that are used, and warnings."""
    admitted = admit(runs, car)
    return admitted.runs, admitted.warnings


def test_a_good_run_is_left_as_it_is():
    run = gentle()
    kept, warnings = usable([run], CAR)
    np.testing.assert_array_equal(kept[0].r, run.r)
    assert len(kept) == 1
    assert len(kept[0]) == len(run)
    assert warnings == []


def test_what_is_admitted_comes_with_its_doubts():
    runs = [gentle(), dataclasses.replace(changed(gentle(), "beta", 400, 500, 1.5), name="run_1")]
    runs = [dataclasses.replace(run, v=3.6 * run.v) for run in runs]
    admitted, doubts = admit(runs, CAR), suspicions(runs, CAR)
    kept, left_out = usable_parts(runs, screened(runs)[0], CAR)
    assert [(part.name, len(part)) for part in admitted.runs] == [(part.name, len(part)) for part in kept]
    assert admitted.doubts == doubts != []
    assert admitted.warnings == [doubt.sentence for doubt in doubts] + screened(runs)[1] + left_out


def test_spins_and_standstill_are_cut_and_reported_with_their_times():
    run = changed(changed(gentle(), "beta", 400, 500, 1.5), "v", 900, 950, 0.5)
    kept, warnings = usable([run], CAR)
    assert [(part.name, len(part)) for part in kept] == [("run_0_0", 400), ("run_0_1", 400), ("run_0_2", 250)]
    assert "only 0.00 to 3.99 s and 5.00 to 8.99 s and 9.50 to 11.99 s are used" in warnings[0]
    assert "a spin from 4.00 to 4.99 s" in warnings[0]
    assert "slower than the 1.7 m/s that slips need from 9.00 to 9.49 s" in warnings[0]
    assert "revers" not in warnings[0]


def test_reversing_is_no_spin_and_a_part_of_its_own_with_a_negative_speed():
    run = changed(gentle(), "beta", 400, 700, 3.0)
    assert list(np.flatnonzero(reversing(run, CAR))) == list(range(400, 700))
    kept, warnings = usable([run], CAR)
    assert [len(part) for part in kept] == [400, 300, 500]
    np.testing.assert_array_equal(kept[1].v, -run.v[400:700])
    np.testing.assert_allclose(kept[1].beta, run.beta[400:700] - np.pi)
    assert min(kept[0].v.min(), kept[2].v.min()) > 0.0
    assert warnings == []
    without, warnings = usable_parts([run], screened([run])[0], CAR, reverse=False)
    assert sum(len(part) for part in without) == 900
    assert "reversing from 4.00 to 6.99 s" in warnings[0]


@pytest.mark.parametrize("read", [1.0, -1.0])
def test_a_rim_speed_without_its_sign_gets_that_of_the_speed(read):
    run = changed(gentle(), "beta", 0, 1200, -3.1)
    run = dataclasses.replace(run, omega_r=read * run.v)
    (kept,), _ = usable([run], CAR)
    np.testing.assert_array_equal(kept.omega_r, -run.v)


def test_a_spin_through_backwards_is_no_reversing():
    run = gentle()
    r, beta = run.r.copy(), run.beta.copy()
    r[400:500], beta[400:500] = 5.0, np.linspace(-1.2, -3.0, 100)
    run = dataclasses.replace(run, r=r, beta=beta)
    assert not reversing(run, CAR).any()
    assert not driven(run, CAR)[400:500].any()


def test_a_long_freeze_is_cut_out_and_a_spike_is_filled():
    run = gentle()
    v, r = run.v.copy(), run.r.copy()
    v[500:560], r[800] = v[500], 4.0
    kept, warnings = usable([dataclasses.replace(run, v=v, r=r)], CAR)
    assert [len(part) for part in kept] == [500, 640]
    assert kept[0].filled is not None
    assert not kept[0].filled.any()
    assert list(np.flatnonzero(kept[1].filled)) == [240]
    assert abs(kept[1].r[240] - 0.3 * np.sin(16.0)) < 0.02
    assert "frozen columns from 5.00 to 5.59 s" in " ".join(warnings)


@pytest.mark.parametrize("period", [0.01, 0.02, 0.005])
def test_parts_are_long_enough_in_seconds_not_rows(period):
    cut = round(least_part(CAR) / period)
    run = gentle(12.0, period)
    run = changed(run, "beta", cut, cut + 10, 1.5)
    run = changed(run, "beta", 2 * cut, 2 * cut + 10, 1.5)
    kept, _ = usable([dataclasses.replace(run, name="a")], CAR)
    assert [part.name for part in kept] == ["a_0", "a_1"]  # the part between the two is ten rows short
    assert len(kept[0]) == cut


def test_too_little_is_refused_with_what_would_be_enough():
    with pytest.raises(InvalidLogError, match=r"1.5 s in all are too little: 4 s in all, in parts of 1 s or more"):
        usable([gentle(1.5)], CAR)
    other = gentle(2.5)
    assert len(usable([other, dataclasses.replace(other, name="run_1", v=1.1 * other.v)], CAR)[0]) == 2


def test_too_slow_is_refused_with_the_speed_that_would_be_enough():
    slow = gentle(v=np.full(1200, 1.5))
    with pytest.raises(InvalidLogError, match=r"above 1.5 m/s, too slow .* faster than 1.7 m/s, would be enough"):
        usable([slow], CAR)
    assert slowest_asked(SMALL) == 0.6  # a little above the floor of the slips, whatever the size
    assert len(usable([slow], SMALL)[0]) == 1


def test_short_bursts_between_reversing_are_used_and_reported_in_one_line():
    """Random driving of a 1:5 car: a second forwards, a second backwards, and so on."""
    small = CAR.replace(front_axle_distance=0.18, rear_axle_distance=0.18, mass=10.0)
    runs = []
    for number in range(5):
        run = gentle(30.0)
        phase = (run.t + 0.1 * number) % 2.0
        v = np.where(phase < 0.9, 1.0, 0.8) + 0.005 * np.random.default_rng(number).standard_normal(len(run))
        beta = np.where(phase < 0.9, run.beta, np.pi - 0.05 + run.beta)
        runs.append(dataclasses.replace(run, name=f"run_{number}", v=v, beta=beta, omega_r=v, r=0.2 * run.r))
    kept, warnings = usable(runs, small)
    assert sum(len(part) for part in kept) * 0.01 > 0.95 * 150.0
    assert len(warnings) == 1
    assert warnings[0].startswith("of 150 s of logs ")


def test_a_run_that_is_there_twice_counts_once():
    admitted = admit([gentle(), dataclasses.replace(gentle(), name="run_1")], CAR)
    assert [run.name for run in admitted.runs] == ["run_0"]
    assert "run_1 is rows of run_0 once more: counted once" in admitted.warnings
