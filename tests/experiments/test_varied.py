"""Cars of many structures, and the models that are trained on what is left over of them."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from drift_drake.common.executors import ExecutorConfig
from drift_drake.drive.learnt.bayesian_step import residual
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.samples import load_samples
from experiments.model import varied
from experiments.model.build import OtherBuildError
from experiments.other_worlds.brush_drifters import DRAWN, draw_drifter, draw_wide_drifter


def test_wide_brush_cars_are_drawn_farther_and_remain_cars() -> None:
    wide, plain = [draw_wide_drifter(i, 5) for i in range(60)], [draw_drifter(i, 5) for i in range(60)]
    assert wide[7] == draw_wide_drifter(7, 5)
    for name in DRAWN:
        spread, own = (np.array([getattr(car, name) for car in cars]) for cars in (wide, plain))
        if not name.startswith("lock"):
            assert 1.2 < np.std(spread) / np.std(own) <= 1.5 + 1e-9
        if name not in ("rear_compliance", "roll_steer"):
            assert spread.min() >= 0.0
    assert all(
        (car.vectoring > 0.0) == (i % 3 == 0) and (car.rear_steer != 0.0) == (i % 4 == 1) for i, car in enumerate(wide)
    )


@pytest.mark.slow
def test_both_models_are_made_and_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(varied, "ROUNDS", {"varied": ((3, 2, 1e-3),), "hybrid": ((2, 2, 1e-3), (3, 2, 1e-3))})
    monkeypatch.setattr(varied, "WORLDS", ("brush",))
    config = varied.VariedConfig(output=tmp_path, train=2, wide=1, validation=3, run_on=ExecutorConfig(workers=2))
    varied.main(config)
    for name in ("varied_0", "hybrid_1"):
        model = load_model(tmp_path / f"{name}.npz")
        assert model.content_hash() != load_model().content_hash()
    sizes = {}
    for base in ("varied", "hybrid"):
        samples = load_samples(tmp_path / f"{base}-train-drift.npz")
        left = residual(samples.x, samples.u, samples.x_next, load_model().vehicle.constants())
        sizes[base] = np.median(np.abs(left), axis=0)
    assert (
        sizes["hybrid"][:3] < 0.8 * sizes["varied"][:3]
    ).all()  # the identified cars leave less than the nominal one
    before = (tmp_path / "build.json").read_text()
    varied.main(config)
    assert (tmp_path / "build.json").read_text() == before
    with pytest.raises(OtherBuildError, match="wide"):
        varied.main(dataclasses.replace(config, wide=2))
