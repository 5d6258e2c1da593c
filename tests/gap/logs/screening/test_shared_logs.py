"""Logs of other makers and of real cars: nothing is suspected, and only what is broken is left out."""

import dataclasses
from pathlib import Path

import pytest

from drift_drake.car.log.table import read_case
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import read_mapping
from drift_drake.gap.logs.screening.screened import screened
from drift_drake.gap.logs.screening.suspicions import suspicions
from experiments.benchmarks.log_mutations import with_factors
from experiments.real.cars import RACER, RIM_SPEED, SMALL_CAR

SHARED = Path(__file__).parents[5] / "shared"
needs_cases = pytest.mark.skipif(not (SHARED / "cases").is_dir(), reason="../shared/cases is not there")
needs_data = pytest.mark.skipif(not (SHARED / "data").is_dir(), reason="../shared/data is not there")


def small_car(folder):
    mapping = read_mapping("dart")
    mapping = dataclasses.replace(mapping, formulas={**mapping.formulas, **RIM_SPEED})
    return import_recordings(sorted((SHARED / "data" / "dart" / folder).glob("*.csv")), mapping)[0]


@needs_cases
@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.slow)])
def test_cases_of_another_maker(every):
    for folder in sorted((SHARED / "cases").iterdir())[::every]:
        runs = read_case(folder)
        assert screened(runs)[1] == [], folder
        assert suspicions(runs, VehicleParameters()) == [], folder


@needs_data
@pytest.mark.parametrize("folder", ["floor_b", "free_driving"])
def test_the_small_car(folder):
    runs = small_car(folder)
    assert screened(runs)[1] == []
    assert suspicions(runs, SMALL_CAR) == []


@needs_data
def test_mistakes_with_the_small_car_are_named():
    runs = small_car("free_driving")
    for factors in ({"v": 3.6}, {"r": -1.0}, {"delta_cmd": -1.0}, {"t": 2.0}):
        assert [s.column for s in suspicions(with_factors(runs, factors), SMALL_CAR)] == list(factors)


@needs_data
def test_the_racer_lost_its_inertial_unit_once():
    """Five rows of the recording repeat yaw rate and both accelerations to the last digit."""
    path = SHARED / "data" / "revs_250lm" / "session_01_first.csv"
    runs = import_recordings([path], read_mapping("revs_250lm"), start=60.0, end=150.0)[0]
    clean, sentences = screened(runs)
    assert {(p.column, p.stop - p.start) for p in clean[0].bad if p.kind == "frozen"} == {
        ("r", 5),
        ("ax", 5),
        ("ay", 5),
    }
    assert "r, ax, ay are frozen from 114.38 to 114.42 s" in sentences[0]
    assert sum(p.stop - p.start for p in clean[0].bad if p.kind == "spike") <= 2
    assert suspicions(runs, RACER) == []
