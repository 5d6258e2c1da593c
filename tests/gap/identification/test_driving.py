"""What drives can show of a car: how hard, to which sides, how lively; drives that show little are refused."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.log.table import InvalidLogError, Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.cli.main import BAD_INPUT, main
from drift_drake.gap.identification.driving import Driving, driving_of, reached
from drift_drake.gap.identification.identify import check_known, identify

CAR = VehicleParameters()
LIMIT = CAR.friction * CAR.gravity
GOOD = Driving(
    seconds=60.0, recordings=4, used=0.9, left=0.9, right=0.8, accelerating=0.3, braking=0.2, lively=4.0, torque=True
)


def run_of(lateral, speed=20.0, name="run_0"):
    """A run at constant speed whose lateral acceleration, in friction limits, is a function of time."""
    t = np.arange(0.0, 24.0, 0.01)
    r = lateral(t) * LIMIT / speed
    length = CAR.front_axle_distance + CAR.rear_axle_distance
    noise = np.random.default_rng(0).normal(size=(2, len(t)))
    return Run(name, t, r + 1e-3 * noise[0], speed + 0.01 * noise[1], r * length / speed)


def test_what_is_reached_lasts_half_a_second_in_all():
    values = np.zeros(1000)
    values[[*range(100, 130), *range(500, 525)]] = 2.0  # 0.55 s
    values[700:720] = 9.0
    assert reached(values, np.full(1000, 0.01)) == 2.0
    assert reached(-np.ones(1000), np.full(1000, 0.01)) == 0.0


def test_hard_driving_to_both_sides_misses_nothing_grave():
    found = driving_of([run_of(lambda t: 0.8 * np.sin(3.0 * t)), run_of(lambda t: 0.8 * np.sin(t), name="run_1")], CAR)
    assert found.left == pytest.approx(0.8, abs=0.03)
    assert found.right == pytest.approx(0.8, abs=0.03)
    assert not any(one.grave for one in found.missing())
    assert found.unseen == ()


def test_gentle_driving_shows_no_tyre():
    found = driving_of([run_of(lambda t: 0.03 * np.sin(t))], CAR)
    assert found.gentle
    assert {"friction", "front_stiffness", "mass"} <= set(found.unseen)
    sentence = found.missing()[0].sentence()
    assert sentence.startswith("at most 3 % of the friction limit is used")
    assert "slowly tightened until the car slides" in sentence


def test_driving_well_within_grip_shows_no_friction():
    found = driving_of([run_of(lambda t: 0.35 * np.sin(3.0 * t))], CAR)
    assert not found.gentle
    assert found.unseen == ("friction",)


def test_turning_to_one_side_shows_no_steering_offset():
    found = driving_of([run_of(lambda t: 0.8 * (t / 24.0))], CAR)
    assert found.unseen == ("steering_offset",)
    (one,) = [one for one in found.missing() if "steering_offset" in one.leaves]
    assert one.grave
    assert "the same turns to the right" in one.sentence()
    other = driving_of([run_of(lambda t: -0.8 * (t / 24.0))], CAR)
    assert any("the same turns to the left" in one.drive for one in other.missing())


@pytest.mark.parametrize(
    ("change", "says", "grave"),
    [
        ({"seconds": 8.0}, "8 s of driving can be used", True),
        ({"recordings": 1}, "there is one recording", True),
        ({"lively": 0.1}, "fast sine sweeps", False),
        ({"braking": 0.0}, "deceleration reaches 0 %", False),
    ],
)
def test_each_gap_names_its_drive(change, says, grave):
    assert GOOD.missing() == []
    (one,) = dataclasses.replace(GOOD, **change).missing()
    assert says in one.sentence()
    assert one.grave == grave


def test_friction_that_came_out_higher_was_not_shown_after_all():
    found = dataclasses.replace(GOOD, used=0.6)
    assert found.shows_friction_of(1.0, 1.1)
    assert not found.shows_friction_of(1.0, 1.5)


def test_a_gentle_baseline_is_refused_and_nothing_is_written(tmp_path, capsys):
    gentle = run_of(lambda t: 0.03 * np.sin(t))
    with pytest.raises(InvalidLogError, match="case: too gentle to calibrate a car on: 3 % of the friction limit"):
        identify([gentle], CAR)
    write_run(gentle, tmp_path / "logs" / "run_0.csv")
    CAR.to_yaml(tmp_path / "start.yaml")
    out = tmp_path / "car.yaml"
    assert main(["identify", str(tmp_path / "logs"), "--vehicle", str(tmp_path / "start.yaml"), "--out", str(out),
                 "--quiet"]) == BAD_INPUT  # fmt: skip
    error = capsys.readouterr().err
    assert "circles to the left and to the right" in error
    assert "--force" in error
    assert not out.exists()


def test_a_known_parameter_far_from_what_is_known_is_refused(identified):
    c = identified.calibration
    check_known(c)
    p = c.parameters["mass"]
    off = {**c.parameters, "mass": dataclasses.replace(p, estimate=p.start + 4.0 * p.prior)}
    with pytest.raises(InvalidLogError, match=r"mass, known to .* came out 4 tolerances off.* wider|--force"):
        check_known(dataclasses.replace(c, parameters=off))
