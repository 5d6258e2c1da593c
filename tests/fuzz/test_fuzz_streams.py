"""Recordings of every format, logs that grow, readings of the monitor and faults, spoilt: taken or refused."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("hypothesis", reason="fuzzing needs the extra `test`")

from fuzzing import cases, tried
from hypothesis import given
from hypothesis import strategies as st
from mutations import JUNK, NUMBERS, spoilt
from small_recordings import small_recordings

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import MEASURED_STATE
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.loop.faults import KINDS, Fault, parse_fault
from drift_drake.drive.reference.trajectory import figure_8
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.logs.importing.look import look
from drift_drake.gap.monitoring.monitor import Monitor, make_monitor
from drift_drake.gap.monitoring.watch import monitor_of
from drift_drake.gap.watching.follow import as_rows, growing_rows, head_of, on_the_clock

CAR = VehicleParameters()


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, bytes]:
    return small_recordings(tmp_path_factory.mktemp("recordings"))


@cases(0.1)
@given(data=st.data())
def test_recordings(recordings: dict[Path, bytes], data: st.DataObject) -> None:
    path = data.draw(st.sampled_from(sorted(recordings)))
    read = path.parent if path.name == "metadata.yaml" else path
    path.write_bytes(data.draw(spoilt(recordings[path])))
    try:
        tried(f"recordings ({path.suffix[1:]})", look, read)
    finally:
        path.write_bytes(recordings[path])


def growing_log() -> str:
    rows = [f"{0.05 * k:.2f},{0.1 * np.sin(k):.4f},{12.0 + 0.01 * k:.3f},0.05,100\n" for k in range(80)]
    return "t,r,v,delta_cmd,tau_cmd\n" + "".join(rows)


def followed(content: bytes) -> None:
    """A growing log's rows through the monitor, as `drift-drake watch --follow` takes them."""
    path = Path("run.csv")
    rows = growing_rows(path, iter(content.decode("utf-8", "replace").split("\n")[:-1]))
    head, first = head_of(path, rows)
    monitor = monitor_of(head, CAR, Effects())
    state = monitor.start()
    for row in as_rows(iter([*first, *on_the_clock(path, rows, head)])):
        state = monitor.after_row(state, row.y, row.command, row.t)
    assert state.verdict[:-4].sum() == pytest.approx(1.0)


@pytest.fixture(scope="module")
def monitor() -> Monitor:
    followed(growing_log().encode())  # what is compiled on first use takes its time before the limit counts
    return make_monitor(CAR, used=CHANNELS)


@cases(0.05)
@pytest.mark.usefixtures("monitor")
@given(content=spoilt(growing_log().encode()))
def test_growing_logs(content: bytes) -> None:
    tried("growing logs", followed, content)


@cases(0.05)
@given(spoils=st.lists(st.tuples(st.integers(0, 59), st.integers(0, len(CHANNELS) + 1), NUMBERS), max_size=8))
def test_readings_of_the_monitor(monitor: Monitor, spoils: list[tuple[int, int, float]]) -> None:
    t = 0.01 * np.arange(60)
    rows = np.zeros((60, len(CHANNELS) + 2))
    rows[:, CHANNELS.index("v")] = rows[:, CHANNELS.index("omega_r")] = 12.0
    for row, column, value in spoils:
        rows[row, column] = min(max(float(value), -1e308), 1e308) if abs(value) < 1e308 else np.inf

    def watch() -> None:
        state = monitor.start()
        for k in range(60):
            state = monitor.after_row(state, rows[k, :-2], rows[k, -2:], t[k])
            assert state.verdict[:-4].sum() == pytest.approx(1.0)

    tried("readings", watch)


@cases(0.05)
@given(
    parts=st.tuples(
        st.sampled_from(list(KINDS)), NUMBERS, NUMBERS, NUMBERS, st.one_of(st.sampled_from(MEASURED_STATE), JUNK)
    ),
    count=st.integers(1, 5),
    junk=st.one_of(st.none(), st.tuples(st.integers(0, 4), JUNK)),
)
def test_faults_as_they_are_written(parts: tuple[object, ...], count: int, junk: tuple[int, object] | None) -> None:
    written = [str(part) for part in parts[:count]]
    if junk is not None:
        written[junk[0] : junk[0] + 1] = [str(junk[1])]
    fault = tried("faults", parse_fault, ":".join(written))
    assert fault is None or isinstance(fault, Fault)


def faulted_loop(guarded: bool, *faults: Fault) -> ClosedLoop:
    control = ControlConfig(horizon=8, period=0.02, delay=0.02)
    if not guarded:
        control = ControlConfig(horizon=8, period=0.02, delay=0.02, screening=False, patience=0.0)
    return ClosedLoop(CAR, figure_8(CAR), NominalStepModel(CAR), control=control, faults=list(faults))


@pytest.fixture(scope="module")
def _compiled_loop() -> None:
    """What is compiled on first use takes its time before the limit counts."""
    loop = faulted_loop(True, Fault("spike", 0.04, 0.1, 1.0, "r"))
    loop.run(loop.initial_context(0), RunLimits(time_factor=0.008))


@cases(0.005, few=6)
@pytest.mark.usefixtures("_compiled_loop")
@given(
    kind=st.sampled_from(list(KINDS)),
    size=st.floats(-1e300, 1e300),
    channel=st.sampled_from(MEASURED_STATE),
    guarded=st.booleans(),
)
def test_faults_of_any_size(kind: str, size: float, channel: str, guarded: bool) -> None:
    """No wrong number reaches the car, guarded or not."""
    fault = tried("faults of any size", Fault, kind, 0.04, 0.1, size, channel)
    if fault is None:
        return
    loop = faulted_loop(guarded, fault)
    run = tried("faulted loops", loop.run, loop.initial_context(0), RunLimits(time_factor=0.008))
    assert run.outcome != "simulation failed", run.error
    assert np.isfinite(run.table[["delta", "tau", "r", "v", "beta", "e"]].to_numpy()).all()
