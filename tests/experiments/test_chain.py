"""The whole chain on another program's car: what drives is what the informative drives choose."""

import dataclasses
from pathlib import Path

import pytest

from drift_drake.car.car_file import read_car
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import read_case
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.choose.choice import Choice, Findings
from drift_drake.gap.choose.identified import IdentifiedCar
from experiments.drifting.chain import ChainConfig, believed, main
from experiments.drifting.runs import Learnt


def test_the_choice_decides_what_drives() -> None:
    config = ChainConfig()
    car = IdentifiedCar(VehicleParameters(), Effects())
    near, far = (Choice(Findings(car, error), limit=0.01) for error in (0.005, 0.1))
    assert believed(near, config) == ("the identified car", car)
    name, believes = believed(far, config)
    assert name == "the learnt model of many structures, adapting"
    assert isinstance(believes, Learnt)
    assert believes.adapting
    name, believes = believed(Choice(Findings(car, 0.1, surprise=5.0), 0.01, surprise_limit=9.0), config)
    assert name == "the identified car and what it leaves over"
    assert isinstance(believes, Learnt)
    assert believes.car == car
    assert believed(far, dataclasses.replace(config, model="identified"))[1] == car
    assert isinstance(believed(near, dataclasses.replace(config, model="adapting"))[1], Learnt)
    assert isinstance(believed(Choice(Findings(None), 0.01), config)[1], Learnt)


@pytest.mark.slow
def test_a_car_of_another_program_is_gathered_drifted_and_diagnosed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mujoco", reason="an extra: worlds")
    folder = tmp_path / "chain"
    main(ChainConfig(plant="mujoco", vehicle=1, out=folder))
    printed = capsys.readouterr().out
    assert "| figure_8 | completed | 100% |" in printed
    assert "Not diagnosed" not in printed
    assert len(read_case(folder / "logs" / "lane")) == 2
    assert "- Nothing was learnt from figure_8: of the drifts in curves to the left" in printed
    assert "| loops again | completed | 100% |" in printed
    assert len(read_case(folder / "logs" / "drifts")) == 3  # both courses, and the loops again
    read_car(folder / "corrected.yaml")
    assert {"replay.html", "overhead.png", "report.md"} <= {path.name for path in folder.iterdir()}
