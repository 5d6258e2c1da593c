"""What no car can do is refused; what only few cars do, or few rows show, is not."""

import numpy as np
import pytest

from drift_drake.car.log.plausible import implausible

ROWS = 500
T = np.arange(ROWS) * 0.01


def reported(**changes):
    columns = dict.fromkeys(("t", "x", "y", "psi", "beta", "omega_r", "ax", "ay", "tau_cmd"))
    columns |= {"t": T, "r": 0.3 * np.sin(T), "v": np.full(ROWS, 10.0), "delta_cmd": 0.1 * np.sin(T)}
    return implausible(columns | changes, 0.01)


def spiked(values, spike):
    values = values.copy()
    values[100:103] = spike
    return values


def test_a_small_car_may_turn_fast():
    r = 8.7 * np.sin(2.0 * T)
    psi = np.cumsum(r) * 0.01
    assert reported(r=r, v=np.full(ROWS, 2.0)) is None
    assert reported(r=r, v=np.full(ROWS, 2.0), psi=psi) is None
    assert reported(r=r, v=np.full(ROWS, 9.0), psi=np.angle(np.exp(1j * psi))) is None


@pytest.mark.parametrize("psi", [None, 0.3 - 0.3 * np.cos(T)])
def test_degrees_per_second_are_refused(psi):
    assert "column r reaches 17.1874, and" in reported(r=np.degrees(0.3 * np.sin(T)), psi=psi, v=np.full(ROWS, 20.0))


def test_a_heading_in_degrees_is_refused():
    assert "column psi does not agree with r" in reported(psi=np.linspace(0.0, 300.0, ROWS), r=np.full(ROWS, 0.01))


@pytest.mark.parametrize(("column", "spike"), [("v", 300.0), ("v", -40.0), ("r", 90.0), ("delta_cmd", 9.0)])
def test_a_spike_is_left_to_the_screening(column, spike):
    good = {"v": np.full(ROWS, 10.0), "r": 0.3 * np.sin(T), "delta_cmd": 0.1 * np.sin(T)}
    assert reported(**{column: spiked(good[column], spike)}) is None


def test_absurd_numbers_are_refused():
    assert "column v holds 1e+30 in row 100; fill or cut it" in reported(v=spiked(np.full(ROWS, 10.0), 1e30))
    assert "column r holds -2e+07 in row 100" in reported(r=spiked(0.3 * np.sin(T), -2e7))


def test_other_units_are_guessed():
    assert reported(v=np.full(ROWS, 200.0)).endswith("expected m/s below 150; it looks like km/h, convert it")
    assert reported(delta_cmd=np.full(ROWS, 20.0)).endswith(
        "it looks like degrees, or the steering wheel's angle, convert it"
    )
    assert "the wheel's rad/s" in reported(omega_r=np.full(ROWS, 333.0))
    assert reported(v=np.full(ROWS, -3.0)).startswith("column v is negative (-3)")
