"""Readings that jump are no change of the car; what goes on being far off is believed."""

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.monitoring.bank import allowance
from drift_drake.gap.monitoring.baselines import block_sums
from drift_drake.gap.monitoring.monitor import Monitor, State, make_monitor
from drift_drake.gap.monitoring.watch import WATCHED, Row, rows_of
from experiments.monitoring.drives import changed_drive

AT = 150


@pytest.fixture(scope="module")
def own_run() -> Run:
    return changed_drive("slalom", Effects(), 1.0, seed=7, duration=3.0)


@pytest.fixture(scope="module")
def monitor() -> Monitor:
    return make_monitor(VehicleParameters(), used=WATCHED)


def spoilt(rows: list[Row], channel: str, size: float, count: int) -> list[Row]:
    """The rows with so much added to some readings of a channel."""
    out = [row._replace(y=row.y.copy()) for row in rows]
    for row in out[AT : AT + count]:
        row.y[CHANNELS.index(channel)] += size
    return out


def states(monitor: Monitor, rows: list[Row]) -> list[State]:
    out = [monitor.start()]
    for row in rows:
        out.append(monitor.after_row(out[-1], row.y, row.command, row.t))
    return out


@pytest.mark.parametrize(
    ("channel", "size", "count"), [("r", 0.3, 1), ("r", 2.0, 5), ("v", 30.0, 5), ("ay", 50.0, 3), ("beta", 1e300, 1)]
)
def test_a_spike_leaves_no_trace_in_the_verdict(
    monitor: Monitor, own_run: Run, channel: str, size: float, count: int
) -> None:
    for state in states(monitor, spoilt(list(rows_of(own_run)), channel, size, count)):
        assert state.verdict[0] > 0.5


def test_what_lasts_is_believed(monitor: Monitor, own_run: Run) -> None:
    rows = list(rows_of(own_run))
    after = states(monitor, spoilt(rows, "r", 0.3, len(rows)))
    most = int(allowance(monitor.bank))
    left = [state.clock[3] for state in after[AT : AT + most + 2]]
    assert left == [most - k for k in range(most + 1)] + [pytest.approx(left[-1])]
    assert after[-1].verdict[0] < 0.05


def test_a_days_sums_are_without_spikes(monitor: Monitor, own_run: Run) -> None:
    r = own_run.r.copy()
    r[AT] += 2.0
    clean, other = (block_sums(monitor, run)[0] for run in (own_run, Run(**{**vars(own_run), "r": r})))
    assert other.rows == clean.rows == 200.0
    assert float(other.energy) == pytest.approx(float(clean.energy), rel=0.05)
    seen = np.diag(clean.information) > 0.0  # these drives meet no power limit
    deviations = (other.score - clean.score)[seen] / np.sqrt(np.diag(clean.information)[seen])
    assert np.abs(deviations).max() < 1.0
