"""The Runge-Kutta step: of fourth order, in time too, and exact under a complex step."""

import math

import numpy as np
import pytest

from drift_drake.car.integrate import ramp, runge_kutta


def decay(x, command, rate, out):
    """x' = u - rate x, and a number behind the rates, as accelerations are."""
    out[0] = command[0] - rate * x[0]
    out[1] = 7.0


def end_of(steps, x=1.0, rate=2.0):
    """x after a second, the command going from 0 to 1."""
    z = np.array([x], dtype=type(x))
    k, work, ends = np.empty(2, z.dtype), np.empty((2, 1), z.dtype), (np.zeros(2), np.ones(2))
    for i in range(steps):
        at = [ramp(*ends, (i + share) / steps) for share in (0.0, 0.5, 1.0)]
        runge_kutta(decay, z, *at, 1.0 / steps, rate, k, work)
    return z[0]


EXACT = math.exp(-2.0) + 0.5 - 0.25 * (1.0 - math.exp(-2.0))


def test_halved_steps_leave_a_sixteenth_of_the_error():
    coarse, fine = (abs(end_of(steps) - EXACT) for steps in (10, 20))
    assert coarse / fine == pytest.approx(16.0, rel=0.15)
    assert fine < 1e-6


def test_a_complex_step_gives_the_sensitivity():
    assert end_of(40, x=1.0 + 1e-30j).imag / 1e-30 == pytest.approx(math.exp(-2.0), rel=1e-6)
