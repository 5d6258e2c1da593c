"""`drift_drake.import_logs`: runs as they are, and as a case folder."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from test_importing_importer import PLAIN, plain_table

import drift_drake
from drift_drake.common.errors import DriftDrakeError


@pytest.fixture
def files(tmp_path: Path) -> Path:
    plain_table().to_csv(tmp_path / "lap.csv", index=False)
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(PLAIN))
    return tmp_path


def test_what_is_written_is_what_is_returned(files: Path) -> None:
    runs, report = drift_drake.import_logs(files / "lap.csv", files / "mine.yaml")
    assert len(runs[0]) == 2401
    assert report.remarks == []
    assert not (files / "out").exists()
    drift_drake.import_logs([files / "lap.csv"], files / "mine.yaml", files / "out", end=12.0)
    (run,) = drift_drake.read_case(files / "out")
    np.testing.assert_allclose(run.v[:500], runs[0].v[:500], atol=0.05)
    assert len(run) < 1300
    with pytest.raises(DriftDrakeError, match="holds runs already; give a new folder"):
        drift_drake.import_logs(files / "lap.csv", files / "mine.yaml", files / "out")


def test_what_cannot_be_used_is_said(files: Path) -> None:
    with pytest.raises(DriftDrakeError, match="give a start before the end"):
        drift_drake.import_logs(files / "lap.csv", files / "mine.yaml", start=3.0, end=2.0)
    with pytest.raises(DriftDrakeError, match="wind: is not a column of the log"):
        drift_drake.import_logs(files / "lap.csv", files / "mine.yaml", trust=["wind"])
