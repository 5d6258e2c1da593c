"""The diagram that plays a log's commands: the true car gives the log again, others do not, spins are survived."""

import dataclasses

import numpy as np
import pytest

from diagrams.replay import side_by_side, wide_table
from drift_drake.car.log.table import InvalidLogError
from drift_drake.car.parameters import VehicleParameters
from drift_drake.view.playback.play import compare, drawn
from drift_drake.view.playback.side_by_side import CarModel, SideBySide, windows


def test_windows_cover_what_is_driven():
    driven = np.ones(10, dtype=bool)
    assert windows(driven, 0) == [(0, 9)]
    assert windows(driven, 4) == [(0, 4), (4, 8), (8, 9)]
    driven[4:6] = False
    assert windows(driven, 0) == [(0, 3), (6, 9)]
    assert windows(driven, 2) == [(0, 2), (2, 3), (6, 8), (8, 9)]
    assert windows(np.zeros(5, dtype=bool), 2) == []


def test_the_true_car_gives_its_log_again(slalom, cars):
    """Biased and late sensors included: what is left is their noise."""
    played = SideBySide(slalom, cars).run(1.0)
    rms = compare(played).rms
    for state, noise in (("r", 0.002), ("v", 0.02), ("beta", 0.002), ("omega_r", 0.04)):
        assert rms[state]["corrected"] < 1.6 * noise, state
    assert rms["position"]["corrected"] < 0.04  # its own noise, and that of the course it starts with
    assert rms["r"]["nominal"] > 5.0 * rms["r"]["corrected"]
    table = played.cars["corrected"]
    assert list(table["t"]) == list(played.real["t"])
    assert table["v"].isna().sum() == 4  # what a late sensor shows first
    assert played.real["window"].max() == 3
    wide = wide_table(played)
    assert len(wide) == len(slalom)
    assert {"real_r", "nominal_r", "corrected_x", "delta_cmd"} <= set(wide.columns)
    # A row of NaN more at each restart, in the cars' pictures alone.
    lines = drawn(played)
    assert len(lines["real"]) == len(lines["nominal"]) == len(slalom) + 3
    assert lines["real"].notna().all().all()


def test_it_replays_to_the_bit_and_errors_grow_without_restarts(slalom, cars):
    diagram = SideBySide(slalom, cars)
    often, again, never = (diagram.run(h) for h in (0.5, 0.5, 0.0))
    np.testing.assert_array_equal(often.cars["nominal"], again.cars["nominal"])
    assert compare(often).rms["position"]["nominal"] < 0.5 * compare(never).rms["position"]["nominal"]


def test_a_log_without_torque_follows_the_rim_speed(slalom, cars):
    played = SideBySide(slalom.without("tau_cmd"), cars).run(1.0)
    assert any("no tau_cmd" in remark for remark in played.remarks)
    assert compare(played).rms["omega_r"]["corrected"] < 0.1


def test_a_log_without_torque_and_rim_speed_keeps_the_speed(slalom, cars):
    played = SideBySide(slalom.without("tau_cmd", "omega_r"), cars).run(1.0)
    assert any("a force keeps the measured speed" in remark for remark in played.remarks)
    rms = compare(played).rms
    assert "omega_r" not in rms
    assert side_by_side(drawn(played)) is not None
    assert rms["v"]["nominal"] < 0.1
    assert rms["r"]["corrected"] < 0.5 * rms["r"]["nominal"]


def test_missing_positions_and_sideslip_are_derived_and_said(slalom, cars):
    whole = SideBySide(slalom, cars).motion
    bare = SideBySide(slalom.without("x", "y", "psi", "beta"), cars)
    assert [remark.split(":")[0] for remark in bare.remarks] == ["no psi", "no beta and no positions", "no x and y"]
    # The gyro's bias of 0.03 rad/s turns an integrated path by 0.12 rad in four seconds.
    assert np.hypot(bare.motion.x - whole.x, bare.motion.y - whole.y).max() < 5.0
    from_positions = SideBySide(slalom.without("beta"), cars).motion
    assert np.sqrt(np.mean((from_positions.beta - whole.beta) ** 2)) < 0.01


def test_spins_end_predictions_and_no_more(slalom):
    """The real car's spin is left out; a simulated car's ends its window, and the other car's goes on."""
    beta = np.where((slalom.t > 2.0) & (slalom.t < 2.5), 1.3, slalom.beta)
    grip = VehicleParameters()
    tail_heavy = CarModel(grip.replace(front_axle_distance=2.0, rear_axle_distance=0.47))
    everything = {"delta_cmd": np.full(len(slalom), 0.3), "tau_cmd": np.full(len(slalom), 400.0)}
    run = dataclasses.replace(slalom, beta=beta, **everything)
    played = SideBySide(run, {"nominal": CarModel(grip), "tail_heavy": tail_heavy}).run(0.0)
    spun = (run.t > 2.0) & (run.t < 2.5)
    assert (played.real["window"][spun] == -1).all()
    assert played.cars["nominal"]["v"][spun].isna().all()
    assert played.lost["tail_heavy"]
    comparison = compare(played)
    assert comparison.seconds < comparison.driven
    assert all(np.isfinite(error) for errors in comparison.rms.values() for error in errors.values())


def test_a_log_of_standstill_is_refused(slalom, cars):
    with pytest.raises(InvalidLogError, match=r"run_0: the car stands \(below 3\.0 m/s .* throughout; log a drive"):
        SideBySide(dataclasses.replace(slalom, v=np.zeros(len(slalom))), cars)
