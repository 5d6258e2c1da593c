"""Tables of samples."""

import re
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.bayesian_step import euler_step, residual
from drift_drake.drive.learnt.command_lag import LAGGED
from drift_drake.drive.learnt.samples import (
    InvalidSamplesError,
    Samples,
    content_hash,
    load_samples,
    mirrored,
    save_samples,
)


@pytest.fixture
def samples() -> Samples:
    generator = np.random.default_rng(0)
    x = np.array([0.5, 11.0, -0.5, 16.0, 0.2, 0.1, -0.1, 140.0]) + 0.1 * generator.normal(size=(7, 8))
    u = np.array([-0.1, 150.0]) + 0.05 * generator.normal(size=(7, 2))
    return Samples(x, u, u + 0.01, x + 0.02, np.full(7, 0.05), np.array([0, 0, 0, 0, 1, 1, 1]),
                   np.array([0, 0, 1, 1, 2, 2, 2]))  # fmt: skip


def test_a_table_comes_back_with_its_hash(samples: Samples, tmp_path: Path) -> None:
    save_samples(samples, tmp_path / "a" / "table.npz")
    again = load_samples(tmp_path / "a" / "table.npz")
    assert content_hash(again) == content_hash(samples)
    assert content_hash(samples._replace(x=samples.x + 1e-12)) != content_hash(samples)


def test_drives_and_vehicles_are_found(samples: Samples) -> None:
    assert [len(drive.x) for drive in samples.drives()] == [2, 2, 3]
    assert len(samples.of_vehicle(1).x) == 3


def test_the_mirror_image_is_the_same_car_turning_the_other_way(samples: Samples) -> None:
    mirror = mirrored(samples)
    car = VehicleParameters().constants()
    sign = np.array([-1.0, 1.0, -1.0, 1.0])
    np.testing.assert_allclose(
        residual(mirror.x, mirror.u, mirror.x_next, car), residual(samples.x, samples.u, samples.x_next, car) * sign,
        rtol=0, atol=1e-12)  # fmt: skip
    step, mirror_step = (euler_step(s.x[:, :6], s.u, s.curvature, car) for s in (samples, mirror))
    np.testing.assert_allclose(mirror_step[:, 4:], -step[:, 4:], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(mirror.x[:, LAGGED], samples.x[:, LAGGED] * [-1.0, 1.0])
    np.testing.assert_array_equal(mirror.x_next[:, LAGGED], samples.x_next[:, LAGGED] * [-1.0, 1.0])
    assert set(mirror.vehicle) == {2, 3}
    assert set(mirror.drive) == {3, 4, 5}


def test_bad_tables_are_named(samples: Samples, tmp_path: Path) -> None:
    path = tmp_path / "table.npz"
    with pytest.raises(InvalidSamplesError, match=r"table\.npz: no such file"):
        load_samples(path)
    save_samples(samples._replace(u=np.where(np.arange(7)[:, None] == 4, np.nan, samples.u)), path)
    with pytest.raises(InvalidSamplesError, match=r"table\.npz: u is not finite in row 4"):
        load_samples(path)
    np.savez(path, x=samples.x)
    with pytest.raises(InvalidSamplesError, match=r"table\.npz: no column u"):
        load_samples(path)
    save_samples(samples.where(np.zeros(7, dtype=bool)), path)
    with pytest.raises(InvalidSamplesError, match="holds no sample"):
        load_samples(path)


@pytest.mark.parametrize(
    ("column", "shape", "wanted"),
    [("x", (7, 6), (7, 8)), ("x_next", (7, 6), (7, 8)), ("u_next", (7, 1), (7, 2)), ("curvature", (6,), (7,))],
)
def test_a_column_of_another_shape_is_refused(
    samples: Samples, tmp_path: Path, column: str, shape: tuple[int, ...], wanted: tuple[int, ...]
) -> None:
    """As they were made before the model knew of lags, say."""
    path = tmp_path / "table.npz"
    save_samples(samples._replace(**{column: np.zeros(shape)}), path)
    message = re.escape(f"table.npz: {column} has the shape {shape}, not {wanted} (a row a sample; in x and x_next")
    with pytest.raises(InvalidSamplesError, match=message):
        load_samples(path)
