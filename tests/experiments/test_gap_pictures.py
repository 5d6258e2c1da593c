"""The blind check's scores and pictures on made-up answers: the design's figures, with intervals, tier by tier."""

import base64
import hashlib
import json
import zlib

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from experiments.benchmarks.scores import TIERS, scores, true_name
from experiments.gap.blind import Score, case_truth, score, tier_list
from experiments.gap.pictures import cells, outcome


def made_up(count=40, seed=0):
    """Cases of all tiers, answered right three times in four, with the probability that this calls for."""
    rng = np.random.default_rng(seed)
    pairs = []
    for i, tier in enumerate(tier_list(count)):
        truth, _ = case_truth(tier, rng, VehicleParameters())
        label = {"case": f"{i}", "tier": tier, "effects": truth.effects, "strange": truth.strange}
        right = true_name(label)
        named = right if rng.uniform() < 0.75 else str(rng.choice(["aero_drag", "none", "unknown"]))
        verdict = named if named in ("none", "unknown") else "effect"
        causes = named.split("+") if verdict == "effect" else []
        answer = {
            "case": f"{i}",
            "verdict": verdict,
            "causes": causes,
            "posterior": {named: 0.75} | ({"other": 0.25} if named == right else {right: 0.25}),
            "ambiguity": [named, right][: 1 + (named != right)],
            "magnitudes": {c: {"estimate": 1.0, "low": -2.0, "high": 200.0} for c in causes},
            "where": {"states": [], "regime": ""},
            "reduction": {"estimate": 0.99, "low": 0.9, "high": 1.0},
            "seconds": float(rng.uniform(20.0, 40.0)),
        }
        pairs.append((label, answer))
    return pairs


@pytest.fixture(scope="module")
def pairs():
    return made_up()


def test_scores_have_every_figure_by_tier_with_an_interval(pairs):
    result = scores(pairs)
    for figure in ("top-1", "truth in the ambiguity set", "ambiguity set's size", "isolation by tier",
                   "Brier score by tier"):  # fmt: skip
        assert list(result[figure]) == [*TIERS, "all"]
        for part in result[figure].values():
            middle = part["share"] if "share" in part else part["mean"]
            assert part["low"] - 1e-9 <= middle <= part["high"] + 1e-9
    for figure in ("detection", "false alarms", "isolation", "unknown, recalled", "unknown, precision",
                   "magnitude coverage", "reduction's interval holds all of the gap", "Brier score",
                   "seconds, median"):  # fmt: skip
        assert {"low", "high", "count"} <= set(result[figure])


def test_outcomes_and_cells_of_a_pair():
    label = {"tier": "pair", "effects": {"aero_drag": 1.0, "mass_error": 0.1}, "strange": {}}
    one, both, other = (
        {"verdict": "effect", "causes": causes} for causes in (["aero_drag"], ["aero_drag", "mass_error"], ["cg_shift"])
    )
    assert [outcome((label, a)) for a in (one, both, other)] == ["one of two", "right", "other effect"]
    assert cells((label, one)) == [("aero_drag", "aero_drag"), ("mass_error", "not named")]
    assert cells((label, other)) == [("aero_drag", "cg_shift"), ("mass_error", "cg_shift")]
    assert cells((label, {"verdict": "none", "causes": []})) == [("aero_drag", "none"), ("mass_error", "none")]


def test_score_writes_figures_and_pictures(pairs, tmp_path, capsys):
    (tmp_path / "answers").mkdir()
    for label, a in pairs:
        (tmp_path / "answers" / f"{label['case']}.json").write_text(json.dumps(a))
    sealed = base64.b64encode(zlib.compress(json.dumps({"labels": [label for label, _ in pairs]}).encode()))
    (tmp_path / "labels.sealed").write_bytes(sealed)
    manifest = {
        "labels_sha256": hashlib.sha256(sealed).hexdigest(),
        "cases": {label["case"]: {"without": []} for label, _ in pairs},
    }
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    score(Score(tmp_path))
    assert "| top-1, pair |" in capsys.readouterr().out
    drawn = {path.name for path in tmp_path.glob("*.png")}
    assert drawn == {"outcomes.png", "reliability.png", *(f"confusion_{tier}.png" for tier in TIERS)}
