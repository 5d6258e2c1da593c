"""Counts of the model discrepancy's experiment, and the cars that it draws."""

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import VehicleParameters
from experiments.gap.model_discrepancy import DISCREPANCIES, counts, drawn_days, numbers, table


def test_discrepancies_take_turns_and_the_second_day_adds_one_effect():
    days = [drawn_days(np.random.default_rng([3, i]), i, VehicleParameters()) for i in range(len(DISCREPANCIES))]
    assert [next(iter(day.baseline.strange)) for day in days] == list(DISCREPANCIES)
    for day in days:
        assert day.baseline.effects == {}
        assert len(day.changed.effects) == 1
        assert set(day.changed.effects) <= set(CATALOGUE)
        assert (day.changed.strange, day.changed.deviations) == (day.baseline.strange, day.baseline.deviations)


def answered(name, ambiguity, magnitudes):
    return {"name": name, "ambiguity": ambiguity, "magnitudes": magnitudes, "probability": 0.9}


def test_right_answers_are_counted_by_day():
    held = {"aero_drag": {"estimate": 1.0, "low": 0.9, "high": 1.1}}
    car = {"criterion": "prediction", "misfit": {"tyre_curve": 0.28}}
    results = [
        car | {"effect": {"aero_drag": 1.0}, "answers": {
            "changed": answered("aero_drag", ["aero_drag"], held),
            "same": answered("none", ["none"], {})}},
        car | {"effect": {"aero_drag": 2.0}, "answers": {
            "changed": answered("unknown", ["unknown", "aero_drag"], {}),
            "same": answered("unknown", ["unknown"], {})}},
    ]  # fmt: skip
    found = numbers(results)
    assert found["vehicles"] == 2
    assert (found["changed"]["right"], found["same"]["right"]) == (1, 1)
    assert found["changed"]["in_ambiguity_set"] == 2
    assert found["changed"]["magnitudes_held"] == [1]
    assert found["same"]["unknown"] == 1
    rows = table(results).splitlines()[2:]
    assert rows[0] == "| tyre_curve 0.28 | prediction | aero_drag 1 | aero_drag 1 (0.9 to 1.1), 0.90 | none, 0.90 |"
    assert "**unknown**, 0.90 (truth in the ambiguity set) | **unknown**, 0.90 |" in rows[1]
    assert "| changed | 1 of 2 (0.09 to 0.91) | 1 | 2 |" in counts(found)
