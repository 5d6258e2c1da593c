"""What recordings differ by, against linear regressions."""

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.scores import ALIKE, between_recordings, pulls, shrunk, spread

TRUTH = np.array([1.0, -2.0])
BLOCKS = 20


def recordings(rng: np.random.Generator, count: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Designs and measurements of linear recordings, each of which has its own magnitudes."""
    designs = [rng.normal(size=(40, 2)) for _ in range(count)]
    own = [TRUTH + 0.1 * rng.normal(size=2) for _ in range(count)]
    return designs, [x @ q + 0.01 * rng.normal(size=40) for x, q in zip(designs, own, strict=True)]


def regression(designs: list[np.ndarray], measured: list[np.ndarray]) -> np.ndarray:
    return np.asarray(np.linalg.lstsq(np.concatenate(designs), np.concatenate(measured), rcond=None)[0])


def pulled(designs: list[np.ndarray], measured: list[np.ndarray]) -> np.ndarray:
    estimate = regression(designs, measured)
    scores = np.array([-x.T @ (y - x @ estimate) for x, y in zip(designs, measured, strict=True)])
    return pulls(scores, np.full(len(designs), BLOCKS), np.linalg.inv(sum(x.T @ x for x in designs)))


def test_a_recording_pulls_as_leaving_it_out_shows() -> None:
    designs, measured = recordings(np.random.default_rng(0), 40)
    found = pulled(designs, measured)
    for i in range(40):
        without = regression(designs[:i] + designs[i + 1 :], measured[:i] + measured[i + 1 :])
        # To first order in one of forty.
        assert found[i] == pytest.approx(regression(designs, measured) - without, rel=0.1, abs=2e-4)


def test_the_spread_of_estimates_over_populations_of_recordings_is_found() -> None:
    rng = np.random.default_rng(1)
    draws = [recordings(rng, 12) for _ in range(400)]
    found = np.var([regression(*draw) for draw in draws], axis=0)
    single = np.mean([np.diag(spread(pulled(*draw))) for draw in draws], axis=0)
    assert single == pytest.approx(np.full(2, 0.1**2), rel=0.25)  # that of one recording
    assert single / 12 == pytest.approx(found, rel=0.2)
    # Rows that are taken as independent would say a tenth of that.
    assert np.all(found > 10.0 * 0.01**2 / (12 * 40))


def test_one_recording_says_nothing_of_others() -> None:
    assert np.all(spread(pulls(np.array([[0.3, -0.2]]), np.array([BLOCKS]), np.eye(2))) == 0.0)


def test_what_all_recordings_share_is_no_difference() -> None:
    same = np.tile([0.3, -0.2], (3, 1))  # what the equations lack in every recording
    assert pulls(same, np.full(3, BLOCKS), np.eye(2)) == pytest.approx(np.zeros((3, 2)))


def test_what_varies_by_itself_does_so_by_less_than_a_gap() -> None:
    car = VehicleParameters()
    found = dict(zip(CATALOGUE, between_recordings(list(CATALOGUE), car), strict=True))
    assert {name for name, q in found.items() if q > 0.0} == {n for n, info in CATALOGUE.items() if info.varies}
    assert all(2.0 * found[name] <= CATALOGUE[name].least_for(car) for name in found)
    assert found["mass_error"] == 0.0
    assert found["sideslip_bias"] == pytest.approx(0.004)  # [rad]


def test_what_varies_is_scaled_by_the_car() -> None:
    car = VehicleParameters()
    small = car.replace(mass=car.mass / 1000.0)
    assert between_recordings(["aero_drag"], small) == pytest.approx(between_recordings(["aero_drag"], car) / 1000.0)


def test_the_next_recording_is_as_far_off_as_a_few_say() -> None:
    """Of recordings that differ alike in all that the logs show, in units of what they leave open."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(8, 8))
    information = root @ root.T
    alone = np.linalg.inv(information + 1e-6 * np.eye(8))
    draw = np.linalg.cholesky(5.0 * alone)
    distances: dict[str, list[float]] = {"seen": [], "shrunk": []}
    for _ in range(200):
        *some, one = (draw @ rng.normal(size=(8, 4))).T
        seen = np.cov(np.array(some).T)  # of three recordings: in two directions
        floor = 1e-3 * np.diag(np.diag(alone))
        for name, covariance in (("seen", seen), ("shrunk", shrunk(seen, alone, information, 3))):
            distances[name].append(one @ np.linalg.solve(covariance + floor, one))
    assert np.median(distances["seen"]) > 50.0 * 8
    assert 4.0 < np.median(distances["shrunk"]) < 16.0


def test_many_recordings_are_believed_and_one_says_nothing() -> None:
    seen, alone, information = np.diag([2.0, 0.1]), np.diag([0.5, 0.5]), np.diag([1.9, 1.9])
    assert shrunk(seen, alone, information, 10**6) == pytest.approx(seen, abs=1e-4)
    few = shrunk(seen, alone, information, 3)
    assert np.trace(np.linalg.solve(alone, few)) == pytest.approx(np.trace(np.linalg.solve(alone, seen)))
    assert few[1, 1] > 2.0 * seen[1, 1]
    assert np.all(shrunk(0.0 * seen, alone, information, 1) == 0.0)


def test_chance_is_no_difference_between_recordings() -> None:
    """What recordings without differences show by the scatter of their blocks is chance, as many times as is stated."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(6, 6))
    information = root @ root.T
    alone = np.linalg.inv(information + 1e-9 * np.eye(6))
    sizes = []
    for _ in range(400):
        scores = (np.linalg.cholesky(information / 4) @ rng.normal(size=(6, 4))).T  # each of a quarter of the blocks
        seen = spread(pulls(scores, np.full(4, BLOCKS), alone))
        sizes.append(np.trace(np.linalg.solve(alone, seen)) / 6)
    assert np.mean(sizes) == pytest.approx(4.0, rel=0.05)  # the number of recordings
    seen = np.diag([2.0] * 6)
    most = shrunk(seen, np.eye(6), np.eye(6), 3)
    assert shrunk(seen, np.eye(6), np.eye(6), 3, 0.5)[0, 0] == pytest.approx(most[0, 0] - 0.5 * ALIKE / (ALIKE + 2.0))
    assert shrunk(seen, np.eye(6), np.eye(6), 3, 5.0) == pytest.approx(2.0 / (ALIKE + 2.0) * seen)


def test_what_the_logs_do_not_show_does_not_differ_from_recording_to_recording() -> None:
    alone, information = np.diag([0.1, 1.0]), np.diag([9.0, 0.0])  # the second by its prior alone
    found = shrunk(np.diag([0.4, 0.0]), alone, information, 3)
    assert found[0, 0] > 0.0
    assert found[1, 1] == 0.0
