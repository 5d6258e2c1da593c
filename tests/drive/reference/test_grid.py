"""A reference's lookups against NumPy's interpolation and against a car that drives along it."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.reference.trajectory import Reference, figure_8, loops


@pytest.fixture(scope="module")
def references() -> dict[str, Reference]:
    """A closed one and an open one."""
    return {"figure_8": figure_8(VehicleParameters()), "loops": loops(VehicleParameters())}


@pytest.mark.parametrize("name", ["figure_8", "loops"])
def test_lookups_are_linear_between_the_grids_points(references: dict[str, Reference], name: str) -> None:
    reference, rng = references[name], np.random.default_rng(0)
    s = rng.uniform(-20.0, 1.7 * reference.path.length, 300)
    within = s % reference.path.length if reference.path.closed else np.clip(s, 0.0, reference.path.length)
    for i, column in enumerate((reference.r, reference.v, reference.beta, reference.omega_r)):
        np.testing.assert_allclose(reference.state(s)[:, i], np.interp(within, reference.s, column), atol=1e-12)
    for found, column in zip(reference.lane(s), (reference.e_min, reference.e_max), strict=True):
        np.testing.assert_allclose(found, np.interp(within, reference.s, column), atol=1e-12)


@pytest.mark.parametrize("name", ["figure_8", "loops"])
def test_time_and_position_are_each_others_inverse(references: dict[str, Reference], name: str) -> None:
    reference, rng = references[name], np.random.default_rng(1)
    s = rng.uniform(-20.0, 1.7 * reference.path.length, 300)
    np.testing.assert_allclose(reference.position(reference.time(s)), s, atol=1e-9)
    assert reference.time(0.0) == 0.0
    pace = (reference.time(s + 1e-3) - reference.time(s - 1e-3)) / 2e-3
    np.testing.assert_allclose(pace, 1.0 / reference.state(s)[:, 1], rtol=2e-2)


@pytest.mark.parametrize("name", ["figure_8", "loops"])
def test_a_horizon_is_the_reference_at_its_own_pace(references: dict[str, Reference], name: str) -> None:
    reference = references[name]
    for start in np.linspace(-3.0, 1.3 * reference.path.length, 40):
        found = reference.horizon(start, 0.1, 12)
        assert found.s[0] == start
        np.testing.assert_allclose(reference.time(found.s), reference.time(start) + 0.1 * np.arange(13), atol=1e-9)
        np.testing.assert_allclose(found.x_ref, reference.state(found.s), atol=1e-12)
        turned = np.diff(reference.path.heading(found.s))
        np.testing.assert_allclose(found.curvature * np.diff(found.s), turned, atol=5e-4)  # the grid is linear
        middle = reference.path.heading(0.5 * (found.s[1:] + found.s[:-1]))
        np.testing.assert_allclose(np.cos(found.heading - middle), 1.0, atol=1e-4)


def test_nowhere_there_is_nothing(references: dict[str, Reference]) -> None:
    reference = references["figure_8"]
    assert np.isnan(reference.state(np.array([np.nan, np.inf]))[:, :4]).all()
    assert reference.state(np.empty(0)).shape == (0, 6)
