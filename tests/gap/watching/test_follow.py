"""A log that is still being written: complete lines only, and a sentence for what cannot be used."""

import threading
import time

import numpy as np
import pytest

import drift_drake
from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import DriftDrakeError
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.monitoring.events import sentence
from drift_drake.gap.watching.follow import Tail, as_rows, growing_rows, head_of, on_the_clock

HEADER = "t,r,v,beta,omega_r,delta_cmd,tau_cmd\n"


def line(i: int) -> str:
    return f"{0.01 * i:.2f},0.1,10.0,0.0,10.0,0.02,30.0\n"


def test_rows_come_as_they_are_written(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(HEADER + line(0) + line(1)[:7])

    def write() -> None:
        time.sleep(0.15)
        with path.open("a") as file:
            file.write(line(1)[7:] + line(2))

    writer = threading.Thread(target=write)
    writer.start()
    rows = list(growing_rows(path, Tail(path, 0.5).lines()))
    writer.join()
    assert [row["t"] for row in rows] == [0.0, 0.01, 0.02]
    row = next(as_rows(iter(rows[-1:])))
    np.testing.assert_array_equal(row.command, [0.02, 30.0])
    assert np.isnan(row.y[4:]).all()


def test_the_head_is_a_run(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(HEADER + "".join(line(i) for i in range(400)))
    rows = growing_rows(path, Tail(path, 0.1).lines())
    run, first = head_of(path, rows)
    assert len(run) == len(first) == 301
    assert len(list(rows)) == 99


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,r,v\n", "missing column delta_cmd, tau_cmd"),
        ("t,r,v, v\n", "column v is there twice"),
        (HEADER + "0.0,x,1\n", "line 2"),
        (HEADER + line(0)[:-2] + "\xff\n", "line 2"),
        (HEADER, "no rows"),
    ],
)
def test_what_cannot_be_followed_is_said(tmp_path, text, said):
    path = tmp_path / "run.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(DriftDrakeError, match=said):
        head_of(path, growing_rows(path, Tail(path, 0.1).lines()))


@pytest.mark.parametrize("t", ["3.05", "3.0", "nan", "-1"])
def test_a_row_off_the_clock_ends_the_watch(tmp_path, t):
    path = tmp_path / "run.csv"
    path.write_text(HEADER + "".join(line(i) for i in range(302)) + line(302).replace("3.02", t))
    rows = growing_rows(path, Tail(path, 0.1).lines())
    head, _ = head_of(path, rows)
    after = on_the_clock(path, rows, head)
    assert next(after)["t"] == 3.01
    with pytest.raises(DriftDrakeError, match=f"t goes from 3.01 to {float(t):g} s"):
        next(after)


def test_a_heading_does_not_jump_by_a_turn():
    turned = [{"t": 0.0, "psi": psi, "delta_cmd": 0.0, "tau_cmd": 0.0} for psi in (3.0, 3.1, -3.1, np.nan, -3.0)]
    psi = [row.y[CHANNELS.index("psi")] for row in as_rows(iter(turned))]
    np.testing.assert_allclose(psi, [3.0, 3.1, 2 * np.pi - 3.1, np.nan, 2 * np.pi - 3.0])


@pytest.mark.parametrize(
    ("change", "why"), [("cut", "has been cut"), ("written anew", "has been cut"), ("rotated", "has been replaced")]
)
def test_a_log_that_is_cut_or_replaced_is_begun_anew(tmp_path, change, why):
    path = tmp_path / "run.csv"
    path.write_text(HEADER + "".join(line(i) for i in range(20)))
    tail = Tail(path, 0.5)
    rows = growing_rows(path, tail.lines())
    for _ in range(20):
        next(rows)
    if change == "rotated":
        path.replace(tmp_path / "run.csv.1")
        path.write_text(HEADER + "".join(line(i) for i in range(40)))
    else:
        path.write_text(HEADER + (line(7) if change == "written anew" else ""))
    assert list(rows) == []
    assert tail.ended == why
    again = [row["t"] for row in growing_rows(path, tail.lines())]
    assert again == {"cut": [], "written anew": [0.07], "rotated": [round(0.01 * i, 2) for i in range(40)]}[change]
    assert tail.ended == ""
    assert tail.last_end == why


def test_a_log_that_is_not_there_is_waited_for(tmp_path):
    path, said = tmp_path / "run.csv", []

    def write() -> None:
        time.sleep(0.15)
        path.write_text(HEADER + line(0))

    writer = threading.Thread(target=write)
    writer.start()
    assert [row["t"] for row in growing_rows(path, Tail(path, 0.6, said.append).lines())] == [0.0]
    writer.join()
    assert said == [f"{path}: is not there; waiting for it"]
    assert list(Tail(tmp_path / "none.csv", 0.1).lines()) == []


def test_the_watch_of_a_replaced_log_begins_anew_with_a_sentence(tmp_path, changed_run):
    """A second drive is written in place of the first: its change is reported by its own clock."""
    whole, path = tmp_path / "whole.csv", tmp_path / "run.csv"
    write_run(changed_run, whole)
    text = whole.read_text()
    path.write_text("\n".join(text.split("\n")[:330]) + "\n")

    def write() -> None:
        time.sleep(1.5)
        (tmp_path / "next.csv").write_text(text)
        (tmp_path / "next.csv").replace(path)

    writer = threading.Thread(target=write)
    writer.start()
    seen = drift_drake.watch(path, VehicleParameters(), follow=True, idle=3.0)
    writer.join()
    kinds = [event["event"] for event in seen.events]
    anew = kinds.index("anew")
    assert sentence(seen.events[anew]) == "the log has been replaced: the watch begins anew"
    alone = drift_drake.watch(whole, VehicleParameters())
    assert seen.events[anew + 1 :] == alone.events
    assert seen.judged == alone.judged
