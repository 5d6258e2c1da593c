"""Logs with little turning, or noisy and late sensors, in which nothing is wrong: no doubt comes of little evidence."""

import numpy as np
import pytest
from scipy.signal import lfilter

from drift_drake.gap.logs.importing.checks import recording_doubts

PERIOD = 0.01  # [s]


def coloured(rng, rows, seconds):
    """Noise of unit size with a memory of so many seconds [rows]."""
    kept = np.exp(-PERIOD / seconds)
    values = lfilter([1.0], [1.0, -kept], rng.standard_normal(rows + 2000))[2000:]
    return values / np.std(values)


def late(values, seconds):
    kept = np.exp(-PERIOD / seconds)
    return lfilter([1.0 - kept], [1.0, -kept], values, zi=[kept * values[0]])[0]


def gentle_log(seed):
    """Columns of a drive of 8 to 40 s on a straight with a few turns, often to one side, and the wheelbase [m]."""
    rng = np.random.default_rng(seed)
    rows, length = round(rng.choice([8.0, 12.0, 20.0, 40.0]) / PERIOD), rng.choice([0.26, 0.33, 1.6, 2.6, 2.9])
    fast = rng.uniform(4.0, 6.0) if length < 1.0 else rng.uniform(6.0, 30.0)
    v = late(fast * (0.7 + 0.15 * np.clip(coloured(rng, rows, rng.choice([1.0, 3.0])), -2.0, 2.0)), 0.3)
    pull, sides = np.zeros(rows), (1.0,) if rng.random() < 0.5 else (-1.0, 1.0)
    for start in rng.integers(0, rows, rng.integers(1, 6)):
        part = pull[start : start + rng.integers(70, 300)]
        part += rng.choice(sides) * rng.choice([0.2, 0.5, 1.5, 4.0]) * np.sin(np.pi * np.arange(len(part)) / len(part))
    pull = late(pull, 0.1)
    r, bent = pull / v, 1.0 + 0.1 * np.abs(pull)  # tyres yield more in sharp turns
    beta = 0.5 * length * r / v - 0.005 * pull * bent
    noise, forward, across = rng.choice([0.3, 1.0, 3.0]), v * np.cos(beta), v * np.sin(beta)
    ax, ay = np.gradient(forward, PERIOD) - across * r, np.gradient(across, PERIOD) + forward * r
    course = np.cumsum(r) * PERIOD + beta

    def read(values, white, slow=0.0):
        spread = noise * white * rng.standard_normal(rows) + rng.choice([0.0, slow]) * coloured(rng, rows, 0.5)
        return late(values, rng.choice([0.001, 0.02, 0.04])) + spread

    steer = length * r / v + rng.uniform(0.0, 0.003) * length / 2.6 * pull * bent
    return {
        "t": PERIOD * np.arange(rows), "x": np.cumsum(v * np.cos(course)) * PERIOD,
        "y": np.cumsum(v * np.sin(course)) * PERIOD, "psi": np.cumsum(r) * PERIOD,
        "r": read(r, 0.005), "v": read(v, 0.03, 0.05), "beta": read(beta, 0.004, 0.01),
        "omega_r": forward * (1.0 + 0.004 * ax) + noise * 0.03 * rng.standard_normal(rows),
        "ax": read(ax, 0.15, 0.2), "ay": read(ay, 0.15, 0.2),
        "delta_cmd": steer + rng.choice([0.0, 0.003]) * coloured(rng, rows, 0.5),
    }, float(length)  # fmt: skip


SEEDS = (15, 29, 43, 53, 59, 72, 89, 100, 136, 147, 173, 208, 235, 257, 299, 360)


@pytest.mark.parametrize("lacking", [(), ("x", "y", "psi", "beta")])
@pytest.mark.parametrize("seed", SEEDS)
def test_little_evidence_makes_no_doubt(seed, lacking):
    columns, length = gentle_log(seed)
    doubts = recording_doubts([{k: q for k, q in columns.items() if k not in lacking}], PERIOD, length)
    assert doubts.sentences == []
