"""Bad samples are found, named with their times and filled; what only looks like one is left alone."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from drift_drake.gap.logs.importing.smoothing import smooth
from drift_drake.gap.logs.noise import coarse, noise_of, step, white_noise_level, without_jumps
from drift_drake.gap.logs.screening.bad_samples import frozen, spikes
from drift_drake.gap.logs.screening.screened import MEASURED, quality, screen, screened
from experiments.benchmarks.compiled_cases import NOISE

ROWS = 1200
T = np.arange(ROWS) * 0.01


def changed(run, column, start, stop, value):
    values = run.column(column).copy()
    values[start:stop] = value
    return dataclasses.replace(run, **{column: values})


@pytest.mark.parametrize("column", MEASURED)
@pytest.mark.parametrize("rows", [1, 3])
def test_a_spike_is_found_reported_with_its_time_and_filled(case, column, rows):
    run = case[0]
    good = run.column(column)[500]
    bad = changed(run, column, 500, 500 + rows, good + 40.0 * NOISE[column])
    one, sentences = screen(bad)
    assert [(part.column, part.kind, part.start, part.stop) for part in one.bad] == [(column, "spike", 500, 500 + rows)]
    assert list(np.flatnonzero(one.mask())) == list(range(500, 500 + rows))
    assert abs(one.run.column(column)[500] - good) < 12.0 * NOISE[column]
    assert len(sentences) == 1
    assert f"run_0: {column} has a spike at 5.00 s" in sentences[0]
    for other in MEASURED:
        if other != column:
            np.testing.assert_array_equal(one.run.column(other), run.column(other))


def test_several_spikes_close_by_are_all_found(case):
    r = case[0].r.copy()
    for row in (300, 303, 310, 900):
        r[row] += 3.0
    one, sentences = screen(dataclasses.replace(case[0], r=r))
    assert list(np.flatnonzero(one.mask())) == [300, 303, 310, 900]
    assert {part.column for part in one.bad} == {"r"}
    assert "4 spikes at 3.00 s" in sentences[0]
    assert "and 1 more" in sentences[0]


@pytest.mark.parametrize("column", MEASURED)
@pytest.mark.parametrize("rows", [5, 40])
def test_frozen_rows_are_found_reported_and_filled(case, column, rows):
    run = case[1]
    bad = changed(run, column, 300, 300 + rows, run.column(column)[300])
    one, sentences = screen(bad)
    assert [(part.column, part.kind, part.start, part.stop) for part in one.bad] == [
        (column, "frozen", 300, 300 + rows)
    ]
    assert f"{column} is frozen from 3.00 to {run.t[299 + rows]:.2f} s ({rows} rows" in sentences[0]
    assert np.ptp(one.run.column(column)[300 : 300 + rows]) > 0.0 or run.column(column)[299] == bad.column(column)[300]


@pytest.mark.parametrize("share", [0.45, 0.5, 0.7, 0.95])
@pytest.mark.parametrize("column", ["r", "v", "ay"])
@pytest.mark.parametrize("place", ["first", "last", "middle"])
def test_a_sensor_that_freezes_for_most_of_a_run_is_no_yardstick_of_itself(case, column, share, place):
    """Its noise is that of the rows that are measured."""
    run = case[0]
    rows = round(share * len(run))
    start = {"first": 0, "last": len(run) - rows, "middle": (len(run) - rows) // 2}[place]
    one, sentences = screen(changed(run, column, start, start + rows, run.column(column)[start]))
    assert [(part.column, part.kind) for part in one.bad] == [(column, "frozen")]
    assert abs(one.bad[0].stop - one.bad[0].start - rows) <= 2
    assert len(sentences) == 1
    (found,) = quality([run], [one])
    assert found.noise[column] > 0.5 * NOISE[column]


def test_a_sensor_that_falls_to_zero_is_found(case):
    one, _ = screen(changed(case[0], "v", 500, len(case[0]), 0.0))
    assert [(part.kind, part.start, part.stop) for part in one.bad] == [("frozen", 500, len(case[0]))]


@pytest.mark.parametrize("column", ["beta", "ay", "psi"])
def test_a_column_that_is_dead_is_left_out(case, column):
    one, sentences = screen(changed(case[0], column, 0, len(case[0]), 0.0))
    assert one.run.column(column) is None
    assert f"column {column} is dead: 0 in all rows though" in sentences[0]
    dead, sentences = screen(changed(case[0], "r", 0, len(case[0]), 0.0))
    assert dead.dead == ("r",)
    assert "column r is dead" in sentences[0]


def test_a_yaw_rate_that_wraps_is_continued(case):
    run = case[0]
    reach = 1.2 * float(np.max(np.abs(run.r)))
    wrapped = (2.0 * run.r + reach) % (2.0 * reach) - reach
    one, sentences = screen(dataclasses.replace(run, r=wrapped))
    np.testing.assert_allclose(one.run.r, 2.0 * run.r, atol=0.05)
    assert "over and over" in sentences[0]
    assert white_noise_level(without_jumps(wrapped)) == pytest.approx(2.0 * NOISE["r"], rel=0.2)


def test_noise_is_that_between_spikes():
    """Of a yaw rate that is the difference of a wrapped heading: single rows of hundreds of rad/s."""
    rng = np.random.default_rng(0)
    r = 0.5 * np.sin(T) + 0.01 * rng.standard_normal(ROWS)
    r[[100, 700, 900]] -= 2.0 * np.pi / 0.01
    cleaned = without_jumps(r)
    assert np.isnan(cleaned[[100, 700, 900]]).all()
    assert smooth(T, cleaned).noise == pytest.approx(0.01, rel=0.2)
    np.testing.assert_array_equal(without_jumps(np.delete(r, [100, 700, 900])), np.delete(r, [100, 700, 900]))


def test_columns_that_freeze_together_are_reported_in_one_sentence(case):
    run = case[2]
    for column in ("r", "ax", "ay"):
        run = changed(run, column, 600, 620, run.column(column)[600])
    _, sentences = screen(run)
    assert len(sentences) == 1
    assert "run_2: r, ax, ay are frozen from 6.00 to 6.19 s" in sentences[0]


@pytest.mark.parametrize(
    ("column", "value", "rows"),
    [("delta_cmd", -32.0, 1), ("delta_cmd", 2.0, 1), ("delta_cmd", 32.0, 12), ("tau_cmd", 65535.0, 3)],
)
def test_a_command_that_is_impossible_for_a_moment_is_left_out(case, column, value, rows):
    good = case[0].column(column)
    one, sentences = screen(changed(case[0], column, 500, 500 + rows, value))
    assert {(part.column, part.kind) for part in one.bad} == {(column, "spike")}
    assert np.max(np.abs(one.run.column(column))) <= np.max(np.abs(good))
    np.testing.assert_array_equal(one.run.column(column)[: 500 - rows], good[: 500 - rows])
    assert f"{column} has a spike at" in sentences[0]
    assert f"({value:.4g} " in sentences[0]


def test_a_bad_command_that_is_spread_by_resampling_is_left_out_whole(case):
    """A single reading at 20 Hz, on lines to its neighbours at 100 Hz."""
    good, t = case[0].delta_cmd[::5].copy(), case[0].t[::5]
    bad = good.copy()
    bad[100] = 32.0
    run = dataclasses.replace(case[0], delta_cmd=np.interp(case[0].t, t, bad))
    one, _ = screen(run)
    assert np.max(np.abs(one.run.delta_cmd)) <= 1.1 * np.max(np.abs(good))


@pytest.mark.parametrize("column", ["delta_cmd", "tau_cmd"])
def test_a_command_may_jump_pulse_and_be_of_another_unit(case, column):
    """A pulse from rest, a step, and degrees for radians (which is asked about elsewhere) are no bad samples."""
    rest = np.zeros(len(case[0]))
    rest[500:503] = 0.3
    step = np.where(np.arange(len(rest)) < 600, -0.4, 0.4)
    for values in (rest, step, np.degrees(case[0].delta_cmd)):
        one, sentences = screen(dataclasses.replace(case[0], trusted=(column,), **{column: values}))
        assert (one.bad, sentences) == ((), [])


def test_a_sensor_that_dies_is_found(case):
    run = case[0]
    one, _ = screen(changed(run, "v", 1000, len(run), run.v[1000]))
    assert [(part.kind, part.start, part.stop) for part in one.bad] == [("frozen", 1000, len(run))]


@pytest.mark.parametrize(("column", "size"), [("v", 0.1), ("r", 0.01), ("beta", 0.01), ("ay", 0.3), ("x", 0.1)])
def test_coarse_rounding_is_reported_with_its_step_and_cuts_nothing(case, column, size):
    run = case[1]
    rounded = dataclasses.replace(run, **{column: size * np.round(run.column(column) / size)})
    one, sentences = screen(rounded)
    assert one.bad == ()
    assert one.noise_floor == {column: pytest.approx(size / np.sqrt(12.0), rel=1e-3)}
    assert f"{column} comes in steps of {size:.3g} " in sentences[0]
    assert one.run is rounded


def test_rounding_as_fine_as_the_noise_is_no_matter(case):
    run = case[1]
    for digits in (7, 5):
        texts = {c: np.array([float(f"{value:.{digits}g}") for value in run.column(c)]) for c in ("r", "v", "ay")}
        one, sentences = screen(dataclasses.replace(run, **texts))
        assert (one.bad, sentences) == ((), [])


def test_the_step_of_numbers():
    rng = np.random.default_rng(0)
    values = rng.standard_normal(500)
    assert step(0.1 * np.round(values / 0.1) / 3.6) == pytest.approx(0.1 / 3.6, rel=1e-6)
    assert step(values) < 1e-3
    assert step(np.zeros(500)) == 0.0
    assert noise_of(0.12) == pytest.approx(np.std(np.round(values * 1e3 / 120.0) * 0.12 - values * 1e-3 * 1e3), rel=0.1)
    assert not coarse(values, 1e-6)


@pytest.mark.parametrize("hold", [2, 5, 10])
def test_slow_sensors_that_hold_their_readings_are_no_fault(case, hold):
    """A 10 Hz reading held in a 100 Hz table, of noisy and of coarse channels."""
    for run in case:
        held = {c: np.repeat(run.column(c)[::hold], hold)[: len(run)] for c in ("r", "v", "omega_r", "ay")}
        assert screen(dataclasses.replace(run, **held))[0].bad == ()
        coarse_v = 0.1 * np.round(held["v"] / 0.1)
        assert screen(dataclasses.replace(run, v=coarse_v))[0].bad == ()


def test_slow_sensors_that_are_interpolated_are_no_fault(case):
    """Their readings may repeat: a wheel's counts at a steady speed."""
    run = case[0]
    readings = 0.05 * np.round(run.omega_r[::10] / 0.05)
    between = np.interp(run.t, run.t[::10], readings)
    assert screen(dataclasses.replace(run, omega_r=between))[0].bad == ()


@pytest.mark.parametrize("corner", [pytest.param(3.0, marks=pytest.mark.slow), 8.0])
def test_smoothed_signals_are_no_fault(good_cases, corner):
    b, a = butter(2, corner / 50.0)
    for runs in good_cases.values():
        for run in runs:
            smooth = {c: filtfilt(b, a, run.column(c)) for c in MEASURED}
            one, sentences = screen(dataclasses.replace(run, **smooth))
            assert (one.bad, sentences) == ((), [])


def test_good_cases_are_left_as_they_are(good_cases):
    for runs in good_cases.values():
        clean, sentences = screened(runs)
        assert sentences == []
        assert [one.run for one in clean] == runs


@pytest.mark.parametrize(
    "signal",
    [
        np.where(T > 6.0, 1.0, 0.0),  # a step
        np.clip((T - 6.0) / 0.05, 0.0, 1.0),  # a hard ramp
        np.where(T > 6.0, np.exp(-(T - 6.0) / 0.05), 0.0),  # a blow that rings down
        np.where(np.abs(T - 6.0) < 0.05, 1.0, 0.0),  # a pulse of ten rows
        np.sin(2.0 * np.pi * 8.0 * T),
    ],
)
def test_steps_blows_and_fast_motion_are_no_spikes(signal):
    rng = np.random.default_rng(1)
    assert spikes(signal) == []
    assert spikes(signal + 0.01 * rng.standard_normal(ROWS)) == []


def test_white_noise_has_no_spikes():
    rng = np.random.default_rng(2)
    assert all(spikes(rng.standard_normal(ROWS)) == [] for _ in range(50))


def test_what_stands_still_is_not_frozen():
    rng = np.random.default_rng(3)
    v = 10.0 + 0.02 * rng.standard_normal(ROWS)
    noise = 0.01 * rng.standard_normal(ROWS)
    assert frozen(np.zeros(ROWS), v, 0.0) == []
    assert frozen(np.full(ROWS, 3.0), v, 0.0) == []
    # A noiseless car that goes straight until it turns.
    turning = np.where(T > 4.0, 0.3 * (1.0 - np.cos(2.0 * (T - 4.0))), 0.0)
    assert frozen(turning, v, step(turning)) == []
    # A car that halts and goes on: all its sensors rest.
    halted = (T > 5.0) & (T < 7.0)
    speed = np.clip(np.abs(T - 6.0) - 1.0, 0.0, None) * 3.0 + np.where(halted, 0.0, 0.02 * rng.standard_normal(ROWS))
    assert frozen(np.where(halted, 0.0, noise), speed, 0.0) == []
    assert frozen(np.where(halted, 0.0, noise), v, 0.0) == [(501, 700)]


def test_a_wrapped_heading_is_no_spike_and_is_filled_within_its_turn(case):
    run = dataclasses.replace(case[3], psi=np.angle(np.exp(1j * case[3].psi)))
    assert screen(run)[0].bad == ()
    row = int(np.argmax(np.abs(np.diff(run.psi)))) + 1  # where it wraps
    bad = changed(run, "psi", row, row + 1, run.psi[row] + 1.0)
    one, _ = screen(bad)
    assert [(part.start, part.stop) for part in one.bad] == [(row, row + 1)]
    assert abs(np.angle(np.exp(1j * (one.run.psi[row] - run.psi[row])))) < 0.02


@pytest.mark.parametrize("each", [40, 97])
def test_spikes_in_two_rows_of_a_hundred_are_no_yardstick_of_themselves(case, each):
    run = case[0]
    r = run.r.copy()
    at = np.arange(30, len(r) - 30, each)
    r[at] += 2.0 * np.pi
    one, _ = screen(dataclasses.replace(run, r=r))
    assert {part.start for part in one.bad if part.column == "r"} == set(at.tolist())
    np.testing.assert_allclose(one.run.r, run.r, atol=8.0 * NOISE["r"])
