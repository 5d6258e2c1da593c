"""The map from above holds the run, the lane and the cars, and says what it lacks."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection

from drift_drake.view.pictures.overhead import overhead
from drift_drake.view.style import save


def test_one_run_is_coloured_by_its_sideslip_in_degrees(eight, perfect_run, tmp_path):
    figure = overhead({"driven": perfect_run}, eight)
    assert save(figure, tmp_path / "map.png").stat().st_size > 20_000
    axes, bar = figure.axes
    (path,) = [item for item in axes.collections if isinstance(item, LineCollection)]
    np.testing.assert_allclose(path.get_array(), np.rad2deg(perfect_run["beta"].to_numpy()[:-1]))
    assert bar.get_ylabel() == "sideslip [deg]"
    assert axes.get_xlabel() == "x [m]"
    assert axes.get_aspect() == 1.0


def test_cars_of_a_run_do_not_cover_each_other(eight, perfect_run):
    def bodies(every):
        axes = overhead({"driven": perfect_run}, eight, car_every=every).axes[0]
        polygons = [item for item in axes.collections if isinstance(item, PolyCollection)]
        # Lane, wheels, bodies, cabins.
        return [np.mean(path.vertices[:-1], axis=0) for path in polygons[2].get_paths()] if every else polygons[1:]

    assert len(bodies(1.0)) == 8
    close = np.array(bodies(0.05))
    distances = np.hypot(*(close[:, None] - close[None]).T) + 99.0 * np.eye(len(close))
    assert distances.min() > 4.0
    assert bodies(0.0) == []


def test_several_runs_have_a_colour_each_and_a_name(eight, perfect_run):
    other = perfect_run.assign(x=perfect_run["x"] + 1.0)
    axes = overhead({"one": perfect_run, "other": other}, eight).axes[0]
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert names == ["one", "other", "reference", "lane"]


def test_a_run_without_a_column_is_named_and_an_empty_one_too(perfect_run):
    with pytest.raises(ValueError, match=r"run 'driven' lacks the column\(s\) psi, beta"):
        overhead({"driven": perfect_run.drop(columns=["psi", "beta"])})
    with pytest.raises(ValueError, match="run 'driven' is empty"):
        overhead({"driven": perfect_run.iloc[:0]})
    with pytest.raises(ValueError, match="no runs"):
        overhead({})


def test_the_same_picture_is_the_same_file(eight, perfect_run, tmp_path):
    files = [save(overhead({"driven": perfect_run}, eight), tmp_path / f"{k}.svg") for k in range(2)]
    assert files[0].read_bytes() == files[1].read_bytes()
