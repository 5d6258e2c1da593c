"""The posterior's constants from answered cases: what separates them is found, intervals cover."""

import numpy as np
import pytest

from drift_drake.gap.evidence.posterior import PosteriorConstants, read_constants
from experiments.gap.blind import tier_list
from experiments.gap.calibration import fitted_constants, log_score, write_constants


def record(tier, effects, evidence, unexplained, error=0.0):
    name = "+".join(sorted(effects))
    fits = {name: {effect: [q + error, 1.0] for effect, q in effects.items()}} if effects else {}
    label = {"case": "x", "tier": tier, "effects": effects, "strange": {}}
    return label, {
        "evidence": evidence,
        "fits": fits,
        "unexplained": unexplained,
        "implausible": 0.0,
        "catalogue": 28,
    }


def records(spread=1.0):
    rng = np.random.default_rng(0)
    known = [
        record("exact", {"aero_drag": 1.0}, {"": -500.0, "aero_drag": 0.0}, -3.0, spread * rng.standard_normal())
        for _ in range(80)
    ]
    unknown = [record("family", {}, {"": -500.0, "aero_drag": 0.0}, 30.0) for _ in range(10)]
    none = [record("none", {}, {"": 0.0, "aero_drag": -2.0}, -3.0) for _ in range(10)]
    return known + unknown + none


def test_constants_separate_unknown_from_known():
    some = records()
    found = fitted_constants(some)
    assert found.unknown_cost + found.unknown_share * 500.0 < 30.0
    assert log_score(some, found) >= log_score(some, PosteriorConstants())
    assert log_score(some, found) > -0.3


def test_intervals_are_widened_to_cover():
    assert fitted_constants(records(spread=3.0)).interval_factor == pytest.approx(3.0, rel=0.35)
    assert fitted_constants(records(spread=0.3)).interval_factor == 1.0


def test_constants_are_written_and_read(tmp_path):
    constants = PosteriorConstants(temperature=1.5, unknown_cost=7.0)
    write_constants(constants, tmp_path / "c.yaml")
    assert read_constants(tmp_path / "c.yaml") == constants


def test_tiers_come_in_their_shares():
    tiers = tier_list(40)
    assert len(tiers) == 40
    assert tiers.count("exact") == 10
    assert tiers.count("tolerance") == 12
    assert set(tiers) == {"exact", "tolerance", "none", "pair", "family", "removed"}
