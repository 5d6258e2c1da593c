"""Which kind of car `auto` takes: the one that predicts held-out parts better."""

from types import SimpleNamespace

import numpy as np
import pytest

from drift_drake.gap.identification import identify

SINGLE, DOUBLE = (SimpleNamespace(judged=[], without=None, name=name) for name in ("single", "double"))


@pytest.mark.parametrize(("ratio", "name"), [(0.7, "double"), (0.96, "double"), (1.07, "single")])
def test_the_car_with_smaller_errors_on_held_out_parts_is_taken(monkeypatch, ratio, name):
    monkeypatch.setattr(identify, "by_prediction", lambda *_: DOUBLE)
    apart = SimpleNamespace(ratio=ratio, low=ratio - 0.15, high=ratio + 0.15)
    monkeypatch.setattr(identify, "held_out_windows", lambda *_: apart)
    taken, sentence = identify.of_better_kind([], None, SINGLE, lambda *_: None)
    assert taken.name == name
    assert sentence.startswith(
        f"a {name}-track car: on held-out parts the errors of a double-track car are {ratio:.2f}"
    )


def test_where_no_double_track_car_can_be_identified_it_is_single_track(monkeypatch):
    def fails(*_):
        raise np.linalg.LinAlgError("singular")

    monkeypatch.setattr(identify, "by_prediction", fails)
    taken, sentence = identify.of_better_kind([], None, SINGLE, lambda *_: None)
    assert taken is SINGLE
    assert "cannot be identified on these logs (singular)" in sentence
