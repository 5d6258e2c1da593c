"""The estimate's ranges, starts and noise, on made-up logs and innovations."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from drift_drake.car.effects.catalogue import CATALOGUE, wheelbase
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import InvalidVehicleError, Tolerance, VehicleParameters
from drift_drake.gap.estimation.unknowns import BROAD
from drift_drake.gap.identification import estimate as module
from drift_drake.gap.identification.estimate import (
    ENOUGH,
    LARGEST_SPLIT,
    LONGEST_LAG,
    NEAR,
    PARAMETERS,
    RETARDATION,
    ROUNDS,
    SETTLED,
    Trust,
    Whiteness,
    check_effect_names,
    effect_ranges,
    estimate,
    first_magnitude,
    shown_effects,
    trusted,
    whiteness,
    widened,
)

CAR = VehicleParameters()


def run_of(v: float, torque: bool = True) -> Run:
    t = 0.01 * np.arange(200)
    return Run(
        "run_0", t, np.zeros(200), np.linspace(0.0, v, 200), np.zeros(200), tau_cmd=np.zeros(200) if torque else None
    )


def test_names_that_are_none_are_said() -> None:
    check_effect_names(["mass"], ["aero_drag"])
    with pytest.raises(InvalidVehicleError, match=r"^size is no parameter to be held; there are mass,"):
        check_effect_names(["mass", "size"], [])
    with pytest.raises(InvalidVehicleError, match=r"^wind is no effect; the catalogue has"):
        check_effect_names([], ["aero_drag", "wind"])
    assert "steering_offset" in PARAMETERS
    assert not any("wheel_radius_error" in name for name in PARAMETERS)


def test_what_is_not_known_is_believed_broadly_or_as_the_file_says_if_that_is_broader() -> None:
    car = CAR.replace(tolerance=Tolerance(mass=0.01, yaw_inertia=0.9, friction=0.02, front_axle_distance=0.001))
    found = widened(car, ["friction"]).tolerance
    assert found.mass == BROAD.mass
    assert found.yaw_inertia == 0.9
    assert found.friction == 0.02
    assert found.front_axle_distance == pytest.approx(BROAD.front_axle_distance * wheelbase(car))


def test_logs_without_torque_show_no_effect_on_what_it_drives() -> None:
    names = ["aero_drag", "torque_lag", "steering_lag"]
    assert shown_effects(names, [run_of(9.0), run_of(9.0)]) == names
    assert shown_effects(names, [run_of(9.0), run_of(9.0, torque=False)]) == ["steering_lag"]


def test_the_largest_resistances_retard_by_a_share_of_gravity_at_the_top_speed() -> None:
    """Of a drag at the fastest of all runs, of rolling, of a brake that drags."""
    runs = [run_of(5.0), run_of(20.0)]
    names = [name for name in CATALOGUE if CATALOGUE[name].resists]
    found, weight = effect_ranges(names, CAR, runs), CAR.mass * CAR.gravity
    force = {"N s^2/m^2": 20.0**2, "-": weight, "N m": 1.0 / CAR.wheel_radius, "N": 1.0}
    assert "aero_drag" in found
    assert "rolling_resistance" in found
    for name, (low, high) in found.items():
        assert low == 0.0
        assert high * force[CATALOGUE[name].unit] == pytest.approx(RETARDATION * weight)


def test_lags_may_be_twice_as_long_as_the_first_guess_and_splits_half() -> None:
    lags = [name for name, e in CATALOGUE.items() if e.unit == "s" and e.stage in ("command", "actuator")]
    splits = [name for name, e in CATALOGUE.items() if e.share and e.signed]
    assert "steering_lag" in lags
    assert splits
    found = effect_ranges([*lags, *splits, "mass_error"], CAR, [run_of(9.0)], Effects(steering_lag=0.4))
    for name in lags:
        longest = 0.8 if name == "steering_lag" else LONGEST_LAG
        assert found[name] == (-longest if CATALOGUE[name].signed else 0.0, longest)
    for name in splits:
        assert found[name] == (-LARGEST_SPLIT, LARGEST_SPLIT)
    assert "mass_error" not in found


@pytest.mark.parametrize(
    ("given", "low", "high", "start"),
    [(0.3, 0.0, 0.5, 0.3), (0.7, 0.0, 0.5, 0.5), (-0.9, -0.5, 0.5, -0.5), (0.0, -0.5, 0.5, 0.0), (0.0, 0.2, 0.7, 0.3)],
)
def test_an_effect_starts_as_given_within_its_range_or_at_a_share_from_its_least(
    given: float, low: float, high: float, start: float
) -> None:
    assert first_magnitude("aero_drag", Effects(aero_drag=given), low, high, share=0.2) == pytest.approx(start)


class Noisy:
    """A problem whose innovations have the mean square of given noise over its own, squared."""

    def __init__(self, noise: np.ndarray, process: np.ndarray) -> None:
        self.noise, self.process = noise, process

    def replace(self, **changes: np.ndarray) -> "Noisy":
        return Noisy(**{"noise": self.noise, "process": self.process} | changes)


def test_trust_is_in_standard_deviations() -> None:
    found = trusted(Noisy(np.array([2.0, 3.0]), np.array([5.0])), Trust(3.0, 2.0))
    np.testing.assert_array_equal(found.noise, [6.0, 9.0])
    np.testing.assert_array_equal(found.process, [20.0])  # a variance


def test_noise_is_scaled_until_innovations_have_mean_square_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Innovations of a true noise of three times what is stated; fits leave them as large as they are."""
    fits, start = [], np.array([0.5])

    def fit(held: Noisy, *given) -> SimpleNamespace:
        _, theta, _, enough = given
        fits.append((held.noise[0], float(theta[0]), enough))
        return SimpleNamespace(theta=theta + 1.0, filtered=SimpleNamespace(innovations=held))

    monkeypatch.setattr(module, "minimise", fit)
    monkeypatch.setattr(module, "flat", lambda _, held: np.array([3.0, -3.0]) / held.noise[0])
    monkeypatch.setattr(module, "filter_case", lambda held, *_: SimpleNamespace(innovations=held))
    found = estimate(Noisy(np.ones(1), np.ones(1)), ["aero_drag"], start, 2.0)
    # The first round only looks: noise of 2 (twice the process's) is 1.5 times too small. Then it is right.
    assert fits == [(pytest.approx(3.0), 0.5, ENOUGH)]
    assert (found.trust.noise, found.trust.process) == pytest.approx((3.0, 1.5))
    assert found.theta == pytest.approx([1.5])
    assert found.names == ("aero_drag",)
    assert found.problem.noise == pytest.approx([3.0])


@pytest.mark.parametrize("off", [1.0 + 0.5 * SETTLED, 1.0 + 2.0 * SETTLED])
def test_fits_go_on_until_the_scale_has_settled(monkeypatch: pytest.MonkeyPatch, off: float) -> None:
    fits = []

    def fit(held: Noisy, *given) -> SimpleNamespace:
        fits.append(held.noise[0])
        return SimpleNamespace(theta=given[1], filtered=SimpleNamespace(innovations=held))

    monkeypatch.setattr(module, "minimise", fit)
    monkeypatch.setattr(module, "flat", lambda *_: np.full(3, off))
    monkeypatch.setattr(module, "filter_case", lambda held, *_: SimpleNamespace(innovations=held))
    estimate(Noisy(np.ones(1), np.ones(1)), [], np.zeros(1), 1.0)
    rounds = 1 if off < 1.0 + SETTLED else ROUNDS - 1
    np.testing.assert_allclose(fits, off ** np.arange(1, rounds + 1))


def innovations_of(monkeypatch: pytest.MonkeyPatch, runs: list[np.ndarray], used: int = 2) -> Whiteness:
    """Whiteness of innovations [rows, 3] of which the first row does not count, nor do channels that are not used."""
    counted = [np.arange(len(e)) > 0 for e in runs]
    problem = SimpleNamespace(
        runs=[SimpleNamespace(counted=rows, used=np.arange(3) < used) for rows in counted], nuisances=1
    )
    monkeypatch.setattr(module, "make_problem", lambda *_, **__: problem)
    monkeypatch.setattr(module, "filter_case", lambda *_: SimpleNamespace(innovations=runs))
    return whiteness([], CAR, Effects(), None)


def test_white_innovations_are_white_and_coloured_ones_have_their_correlation(monkeypatch: pytest.MonkeyPatch) -> None:
    rng, rows = np.random.default_rng(0), 20_001
    white = rng.normal(size=(rows, 3)) * [1.0, 1.0, 50.0]
    white[0] = 1e6
    found = innovations_of(monkeypatch, [white])
    assert found.mean_square == pytest.approx(1.0, abs=0.05)
    assert found.correlation < 0.03
    assert found.may_be_white
    tied = white.copy()
    for k in range(2, rows):
        tied[k, 1] = -0.6 * tied[k - 1, 1] + 0.8 * white[k, 1]
    tied[1:, 1] += 4.0  # what is constant is no correlation
    tied[1:, 0] *= 2.0
    found = innovations_of(monkeypatch, [tied, white, white])
    assert found.correlation == pytest.approx(0.0, abs=0.03)  # of most runs
    found = innovations_of(monkeypatch, [tied, tied, white])
    assert found.correlation == pytest.approx(0.6, abs=0.03)
    # Each channel's scale is its median's, whatever a few outliers are: 4 of the first, of the second (4 + n)^2.
    second = np.median(tied[1:, 1] ** 2) / chi2.ppf(0.5, 1)
    assert found.mean_square == pytest.approx(0.5 * (4.0 + second), rel=0.05)


def test_innovations_that_are_no_numbers_or_too_few_are_not_white(monkeypatch: pytest.MonkeyPatch) -> None:
    lost = np.zeros((9, 3))
    lost[4, 1] = np.nan
    for innovations in (lost, np.ones((3, 3))):
        found = innovations_of(monkeypatch, [innovations])
        assert (found.mean_square, found.correlation, found.may_be_white) == (np.inf, 1.0, False)
        assert "loses the car" in found.sentence()
    four = np.array([[9.0] * 3, [1.0] * 3, [-1.0] * 3, [1.0] * 3, [-1.0] * 3])
    assert innovations_of(monkeypatch, [four]).correlation == pytest.approx(0.75)
    said = Whiteness(30.0, 0.456).sentence()
    assert "(mean square 30, correlation from row to row 0.46)" in said
    assert not Whiteness(NEAR, 0.0).may_be_white


def test_three_rows_are_enough_for_a_correlation(monkeypatch: pytest.MonkeyPatch) -> None:
    """1, -1 and 1 are 2/3, -4/3 and 2/3 about their mean: -16/9 from row to row, of 24/9."""
    found = innovations_of(monkeypatch, [np.array([[9.0] * 3, [1.0] * 3, [-1.0] * 3, [1.0] * 3])])
    assert found.correlation == pytest.approx(2.0 / 3.0)
    assert found.mean_square == pytest.approx(1.0 / chi2.ppf(0.5, 1), rel=1e-3)
