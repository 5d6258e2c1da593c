"""Each defect of signs and units gets its sentence and no other; a sound log gets none."""

import re

import numpy as np
import pytest
from importing_bench import WHEELBASE, column_doubts, rows

DEGREES = 180.0 / np.pi


def scaled(name, factor):
    return lambda c: c | {name: factor * c[name]}


def without(change, *names):
    return lambda c: {key: values for key, values in change(c).items() if key not in names}


def velocity(c):
    return c | {"vx": c["v"] * np.cos(c["beta"]), "vy": c["v"] * np.sin(c["beta"])}


def delayed(seconds):
    def change(c):
        count = round(seconds / 0.01)
        commands = {"delta_cmd": np.roll(c["delta_cmd"], count)}
        part = slice(abs(count), len(c["t"]) - abs(count))
        return {key: values[part] for key, values in (c | commands).items()}

    return change


ONLY_MOTION = ("x", "y", "psi")
DEFECTS = {
    "yaw rate in degrees": (
        scaled("r", DEGREES),
        r"column r looks like degrees \(57\.3 times what other columns say\): give its unit as degrees in the mapping",
    ),
    "yaw rate converted twice": (
        scaled("r", 1.0 / DEGREES),
        "column r looks like radians converted as if they were degrees",
    ),
    "yaw rate of a z-down frame": (
        scaled("r", -1.0),
        "column r looks mirrored, against the other columns: the log is ISO 8855 .* give its frame",
    ),
    "yaw rate in degrees, no positions": (
        without(scaled("r", DEGREES), *ONLY_MOTION),
        r"column r looks like degrees \(5\d\.\d times what other columns say\)",
    ),
    "yaw rate of a z-down frame, no heading": (without(scaled("r", -1.0), "psi"), "column r looks mirrored"),
    "heading in degrees": (scaled("psi", DEGREES), "column psi looks like degrees"),
    "heading clockwise": (scaled("psi", -1.0), "column psi looks mirrored"),
    "heading from east, course from north": (
        lambda c: c | {"psi": c["psi"] + np.pi / 2.0},
        "the course lies -90 deg from heading plus sideslip",
    ),
    "heading that jumps": (
        lambda c: c | {"psi": c["psi"] + np.where(c["t"] > 12.0, np.pi, 0.0)},
        r"heading jumps by 3.1. rad from one row to the next \(row 1201\)",
    ),
    "positions mirrored": (scaled("y", -1.0), r"column y \(or x\) looks mirrored"),
    "speed in km/h": (scaled("v", 3.6), "column v looks like km/h"),
    "speed in mph": (scaled("v", 1.0 / 0.44704), "column v looks like mph"),
    "speed in km/h, no positions": (
        without(scaled("v", 3.6), *ONLY_MOTION, "beta"),
        "column v looks like km/h",
    ),
    "sideslip as heading minus course": (scaled("beta", -1.0), "column beta looks mirrored"),
    "sideslip in degrees": (scaled("beta", DEGREES), "column beta looks like degrees"),
    "sideslip against v_y": (
        without(lambda c: scaled("beta", -1.0)(velocity(c)), *ONLY_MOTION),
        "column beta looks mirrored",
    ),
    "longitudinal acceleration in g": (scaled("ax", 1.0 / 9.80665), "column ax looks like g"),
    "lateral acceleration in g": (scaled("ay", 1.0 / 9.80665), "column ay looks like g"),
    "lateral acceleration of a z-down frame": (scaled("ay", -1.0), "column ay looks mirrored"),
    "scale of lateral acceleration": (
        scaled("ay", 1.6),
        r"column ay reads 6\d % too large \(ay over v r and the rate of v_y is 1.6",
    ),
    "tilted accelerometer": (
        lambda c: c | {"ay": c["ay"] + 1.7},
        r"column ay reads \+1.7 m/s\^2 besides .* tilted",
    ),
    "wheel speed in km/h": (
        scaled("omega_r", 3.6),
        "column omega_r looks like the wheel's rad/s.*; or omega_r as km/h",
    ),
    "wheel speed as an angular rate": (
        scaled("omega_r", 1.0 / 0.337),
        r"column omega_r looks like the wheel's rad/s, .* \(2\.9\d times .*: multiply it by wheel_radius\.$",
    ),
    "steering in degrees": (scaled("delta_cmd", DEGREES), "column delta_cmd looks like degrees"),
    "steering wheel's angle": (scaled("delta_cmd", 15.0), "column delta_cmd looks like the steering wheel's angle"),
    "steering of a z-down frame": (scaled("delta_cmd", -1.0), "column delta_cmd looks mirrored"),
    "vertical axis down": (lambda c: c | {"az": np.full(len(c["t"]), -9.8)}, "z points down"),
    "vertical acceleration in g": (lambda c: c | {"az": np.full(len(c["t"]), 1.01)}, "it looks like g"),
    "commands early": (delayed(-0.3), r"commands lead the motion by 0.3\d* s .*: clocks not aligned\?"),
    "commands late": (delayed(0.3), r"the motion leads its commands by 0.2\d* s .*: clocks not aligned\?"),
}


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_a_sound_log_gets_no_sentence(noise):
    sound = rows(noise=noise)
    assert column_doubts(sound, 0.01, WHEELBASE) == []
    assert column_doubts(sound, 0.01) == []
    assert column_doubts(velocity(sound), 0.01, WHEELBASE) == []
    assert column_doubts(without(dict, *ONLY_MOTION)(sound), 0.01, WHEELBASE) == []
    assert column_doubts(sound | {"az": np.full(len(sound["t"]), 9.8)}, 0.01) == []


@pytest.mark.parametrize("noise", [0.0, 1.0])
@pytest.mark.parametrize("name", DEFECTS)
def test_a_defect_gets_its_sentence_and_no_other(name, noise):
    change, sentence = DEFECTS[name]
    found = column_doubts(change(rows(noise=noise, seed=1)), 0.01, WHEELBASE)
    assert len(found) == 1, found

    assert re.search(sentence, found[0]), found[0]


def test_commands_of_another_clock_are_said_next_to_another_doubt():
    found = column_doubts(delayed(-0.3)(scaled("ay", 1.6)(rows())), 0.01, WHEELBASE)
    assert len(found) == 2, found
    assert found[0].startswith("column ay reads 6")
    assert "commands lead the motion by 0.3" in found[1]


def test_a_biased_yaw_rate_without_a_heading_is_named_next_to_gravity():
    change = without(lambda c: c | {"r": c["r"] - 0.07}, *ONLY_MOTION, "beta")
    (found,) = column_doubts(change(rows()), 0.01, WHEELBASE)
    assert re.search(r"column ay reads \+.* or does r read -0.0[67]\d* rad/s in a straight line\?", found), found


def test_without_a_wheelbase_steering_is_held_against_any_cars():
    found = column_doubts(scaled("delta_cmd", DEGREES)(rows()), 0.01)
    assert [text[:40] for text in found] == ["column delta_cmd looks like degrees, or "]
    (found,) = column_doubts(scaled("delta_cmd", -1.0)(rows()), 0.01)
    assert "column delta_cmd looks mirrored" in found


def drift(noise):
    """Kinematics of a drift to the left that turns into one to the right, steered against the turn."""
    t = np.arange(0.0, 20.0, 0.01)
    beta = -0.8 * np.tanh(2.0 * np.sin(0.5 * t)) + 0.05 * np.sin(3.0 * t)
    course_rate = -1.2 * beta + 0.1 * np.sin(2.0 * t)
    v = 9.0 + np.sin(0.7 * t)
    course = np.cumsum(course_rate) * 0.01
    along, across = np.gradient(v, 0.01), v * course_rate
    exact = {
        "x": np.cumsum(v * np.cos(course)) * 0.01,
        "y": np.cumsum(v * np.sin(course)) * 0.01,
        "psi": course - beta,
        "r": course_rate - np.gradient(beta, 0.01),
        "v": v,
        "beta": beta,
        "omega_r": 1.3 * v * np.cos(beta),
        "ax": along * np.cos(beta) - across * np.sin(beta),
        "ay": along * np.sin(beta) + across * np.cos(beta),
        "delta_cmd": 0.5 * beta,
    }
    generator = np.random.default_rng(0)
    levels = {"r": 0.02, "v": 0.05, "beta": 0.01, "ax": 0.3, "ay": 0.3, "x": 0.005, "y": 0.005, "psi": 0.002}
    return {"t": t} | {n: z + noise * levels.get(n, 0.0) * generator.standard_normal(len(t)) for n, z in exact.items()}


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_a_drift_gets_no_sentence(noise):
    assert column_doubts(drift(noise), 0.01, WHEELBASE) == []


def test_a_whole_recording_mirrored_agrees_with_itself():
    mirrored = {
        name: -values if name in ("y", "psi", "r", "beta", "ay", "delta_cmd") else values
        for name, values in rows(noise=1.0).items()
    }
    assert column_doubts(mirrored, 0.01, WHEELBASE) == []


def test_little_motion_says_nothing():
    count = 500
    generator = np.random.default_rng(0)
    still = {name: 0.001 * generator.standard_normal(count) for name in ("r", "beta", "psi", "x", "y", "delta_cmd")}
    still |= {"v": 10.0 + 0.001 * generator.standard_normal(count), "ax": 0.1 * generator.standard_normal(count)}
    still |= {"x": 0.1 * np.arange(count)}
    assert column_doubts(still, 0.01) == []
