"""Sequential evidence against brute force, its average run length on white scores, and the end of a change."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from drift_drake.gap.monitoring.evidence import HAZARD, NONE_OF_THE_CATALOGUE, alarm_at, evidence_problem
from drift_drake.gap.monitoring.history import History, no_history, with_block
from drift_drake.gap.monitoring.windowed.null import as_before, log_ratio, verdict_of
from drift_drake.gap.monitoring.windowed.sums import WindowSums, no_windows
from drift_drake.gap.monitoring.windowed.temperature import EXACT, LEAST, beyond, largest, scores_of, temperature_of
from tests.gap.monitoring.windowed.simulated import INFORMATION, NODES, SECONDS, N, null_of_white_scores, window

PROBLEM = evidence_problem(NODES, np.zeros(N))


@pytest.fixture(autouse=True)
def white(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drift_drake.gap.estimation.baseline.HANGS", 0.0)
    monkeypatch.setattr("drift_drake.gap.estimation.baseline.OFF_SHAPE", 0.0)


def drive(rng: np.random.Generator, windows: int, onset: int, amplitudes: np.ndarray) -> list[WindowSums]:
    return [window(rng, amplitudes if i >= onset else np.zeros(N)) for i in range(windows)]


def history_of(windows: list[WindowSums], edge: float = 0.0) -> History[WindowSums]:
    history = no_history(no_windows(N, N))
    for i, one in enumerate(windows):
        since = max(edge - (len(windows) - 1 - i) - 1.0, 0.0)
        history = with_block(history, one, 1.0, since)
    return history


def test_the_odds_are_the_sum_over_onsets_of_likelihood_ratios_by_brute_force() -> None:
    """Two windows, so two onsets; each effect's amplitude is integrated by quadrature."""
    one, two = drive(np.random.default_rng(5), 2, 0, np.array([0.8, 0.0, 0.0]))
    found = verdict_of(PROBLEM, null_of_white_scores(), history_of([one, two]))
    odds = 0.0
    for since in ([two], [one, two]):
        score, variance = sum(w.score for w in since), len(since) * INFORMATION
        for k, node in enumerate(NODES):

            def likelihood(a: float, k: int = k, node=node, s=score, v=variance) -> float:  # type: ignore[no-untyped-def]
                return float(norm.pdf(s[k], v[k] * a, np.sqrt(v[k])) * norm.pdf(a, node.mean, node.deviation))

            low = -12.0 if node.signed else 0.0
            whole = quad(likelihood, low, 12.0, points=[0.0, 1.0], limit=200)[0]
            prior = 1.0 if node.signed else norm.cdf(node.mean / node.deviation)
            ratio = whole / prior / norm.pdf(score[k], 0.0, np.sqrt(variance[k]))
            odds += HAZARD * SECONDS * (1.0 - NONE_OF_THE_CATALOGUE) * ratio * np.exp(PROBLEM.log_prior[k])
    p = found.probabilities
    assert p[1:-1].sum() / p[0] == pytest.approx(odds, rel=0.1)  # the shape's own error tempers a little


@pytest.mark.parametrize("per_hour", [60.0])
def test_false_alarms_come_no_more_often_than_was_asked(per_hour: float) -> None:
    """The statistic less the time is a martingale: no more than T / A of drives of T seconds alarm."""
    null, seconds, drives, alarms = null_of_white_scores(), 12.0, 60, 0
    for seed in range(drives):
        history = no_history(no_windows(N, N))
        for one in drive(np.random.default_rng([7, seed]), round(seconds / SECONDS), 10**6, np.zeros(N)):
            history = with_block(history, one, 1.0, 0.0)
            if verdict_of(PROBLEM, null, history).probabilities[0] < alarm_at(per_hour):
                alarms += 1
                break
    most = drives * seconds * per_hour / 3600.0
    assert alarms <= most + 2.0 * np.sqrt(most)


def test_the_temperature_holds_the_statistic_of_heavy_tails_below_the_time() -> None:
    """Scores that are at times three times as large need a higher one than white scores."""
    null, count = null_of_white_scores(), 150
    white = drive(np.random.default_rng(8), count, count, np.zeros(N))
    bursts = [one._replace(score=one.score * (3.0 if i % 30 < 3 else 1.0)) for i, one in enumerate(white)]
    found = temperature_of(PROBLEM, null, [bursts])
    assert LEAST <= temperature_of(PROBLEM, null, [white]) < found
    scores, shown = scores_of(null, bursts), found / beyond(count, SECONDS)
    seconds = count * SECONDS
    assert largest(PROBLEM, null, scores, shown) <= seconds < largest(PROBLEM, null, scores, shown / EXACT)


def test_a_temperature_grows_with_what_recordings_are_too_short_for() -> None:
    """Of 12,000 s, 60,000 windows, nothing; of their square root a quarter of the evidence, at 0.415 of the level."""
    assert beyond(60_000, 0.2) == pytest.approx(1.0)
    assert beyond(245, 0.2) == pytest.approx(4.0 * np.log(49.0) / np.log(12_000.0), rel=0.01)


def test_a_change_is_found_soon_with_its_cause_and_onset() -> None:
    windows, null = drive(np.random.default_rng(2), 60, 30, np.array([0.0, -2.0, 0.0])), null_of_white_scores()
    found = verdict_of(PROBLEM, null, history_of(windows[:45]))
    assert found.probabilities[0] < alarm_at(0.3)
    assert PROBLEM.names[int(np.argmax(found.probabilities[1:-1]))] == "gyro_bias"
    assert found.low < -0.04 < found.high
    assert found.age == pytest.approx(15 * SECONDS, abs=0.6)


def test_it_is_over_once_the_later_windows_are_normal_and_no_sooner() -> None:
    rng, null = np.random.default_rng(4), null_of_white_scores()
    changed = drive(rng, 60, 30, np.array([0.0, -2.0, 0.0]))
    assert as_before(PROBLEM, null, history_of(changed, 30.0), 30.0, 12_000.0) is None
    over = [*changed, *drive(rng, 20, 20, np.zeros(N))]
    ended = as_before(PROBLEM, null, history_of(over, 50.0), 50.0, 12_000.0)
    assert ended is not None
    assert ended[1].probabilities[0] > 0.9
    assert ended[0].lengths.sum() == pytest.approx(20.0, abs=6.0)
    few = [*changed, *drive(rng, 2, 2, np.zeros(N))]
    assert as_before(PROBLEM, null, history_of(few, 32.0), 32.0, 12_000.0) is None


def test_the_ratio_of_a_change_to_none_is_the_integral_over_its_amplitude() -> None:
    m_then, m = np.diag([3.0, 3.0, 3.0]), np.diag([2.0, 2.0, 2.0])
    w_then, w = np.array([0.1, 5.0, 0.2]), np.array([0.3, 3.0, -0.4])
    precision = 9.0 + 0.25
    q = 15.0 / precision

    def density(a: float) -> float:
        return float(norm.pdf(a, q, precision**-0.5) * np.exp(2.0 * a * 3.0 - 0.5 * 4.0 * a * a))

    assert log_ratio(PROBLEM, w_then, m_then, w, m) == pytest.approx(np.log(quad(density, -5.0, 10.0)[0]), rel=1e-6)
