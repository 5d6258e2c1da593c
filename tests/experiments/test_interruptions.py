"""Commands that are ended and given again, on a small one of every habit; a real one too."""

import json
import signal
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.robustness import interruptions
from experiments.robustness.interruptions import (
    COMMANDS,
    InterruptionsConfig,
    answered,
    last_lines,
    main,
    results,
)
from experiments.robustness.long_commands import LongCommand

STEADY = """
import sys
from drift_drake.common.interruption import ended_at_once

with ended_at_once():
    import time
    from pathlib import Path
    from drift_drake.common.interruption import ended_well
    from drift_drake.common.run_folder import is_done, write_json


def main() -> None:
    for i in range(8):
        path = Path(sys.argv[-1]) / f"{i}.json"
        if not is_done(path):
            time.sleep(0.05)
            write_json(path, {"value": i, "seconds": time.time()})


sys.exit(ended_well(lambda: main() or 0, "", "what is done stays"))
"""
CARELESS = STEADY.replace("if not is_done(path)", "if not path.exists()").replace(
    'write_json(path, {"value": i, "seconds": time.time()})',
    'path.write_text("{"); time.sleep(0.05); path.write_text("{}")',
)


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder, in which the commands `steady` and `careless` are known."""
    for name, text in (("steady", STEADY), ("careless", CARELESS)):
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.setenv("PYTHONPATH", str(Path(interruptions.__file__).parents[2]))
    monkeypatch.setattr(interruptions, "COMMANDS", {
        name: LongCommand(lambda _, out, name=name: [str(tmp_path / f"{name}.py"), str(out)])
        for name in ("steady", "careless")
    })  # fmt: skip
    return tmp_path


def test_a_command_that_writes_files_whole_gives_the_same_results(
    small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = InterruptionsConfig(count=2, commands=("steady",), seed=1, out=small / "out")
    main(config)
    said = capsys.readouterr().out
    assert (
        "of 2 commands (steady): 0 with other results, 0 that could not go on, 0 hangs, 0 not answered in one line"
        in said
    )
    made = {path: path.stat().st_mtime_ns for path in (small / "out").glob("attempt_*.json")}
    main(config)
    assert {path: path.stat().st_mtime_ns for path in made} == made


def test_a_command_that_does_not_is_found_out(small: Path) -> None:
    inputs, out = small / "inputs", small / "undisturbed"
    out.mkdir()
    with interruptions.begun(interruptions.COMMANDS["careless"].arguments(inputs, out), small / "log") as process:
        assert process.wait() == 0
    torn = small / "torn"
    torn.mkdir()
    for path in out.iterdir():
        (torn / path.name).write_text(path.read_text())
    (torn / "3.json").write_text("{ ")
    with pytest.raises(json.JSONDecodeError):
        results(torn)


@pytest.mark.parametrize(
    ("number", "code", "said", "well"),
    [
        (signal.SIGINT, 130, "drift-drake: interrupted; files are as they were before, or complete", True),
        (signal.SIGINT, 0, "done", True),
        (signal.SIGINT, -2, "Traceback\n  File site.py\nKeyboardInterrupt", True),  # Python itself had not started
        (signal.SIGINT, -2, "Traceback\n  File drift_drake/cli/main.py\nKeyboardInterrupt", False),
        (signal.SIGINT, 1, "interrupted\nTraceback", False),
        (signal.SIGTERM, 143, "experiments.demo: terminated; what is done stays", True),
        (signal.SIGTERM, 143, "drift_drake: terminated\nresource_tracker: leaked semaphores", False),
        (signal.SIGTERM, -15, "", True),
        (signal.SIGKILL, -9, "", True),
        (signal.SIGKILL, -9, "resource_tracker: leaked semaphores", False),
    ],
)
def test_a_signal_is_to_be_answered_in_one_line(number: signal.Signals, code: int, said: str, well: bool) -> None:
    assert answered({"code": code, "said": said}, number) == well


def test_times_are_no_results(tmp_path: Path) -> None:
    folders = [tmp_path / "one", tmp_path / "other"]
    for seconds, folder in enumerate(folders):
        folder.mkdir()
        (folder / "a.json").write_text(json.dumps({"x": [1.0, {"seconds": seconds}], "solve_ms_99": seconds}))
        pd.DataFrame({"x": [1.0], "seconds": [seconds]}).to_csv(folder / "b.csv", index=False)
        np.savez(folder / "c.npz", x=np.ones(3), record=json.dumps({"epochs": 3, "seconds": seconds}))
    assert results(folders[0]) == results(folders[1])
    np.savez(folders[1] / "c.npz", x=np.full(3, 1.0 + 1e-15), record=json.dumps({"epochs": 3}))
    assert results(folders[0])["c.npz"] != results(folders[1])["c.npz"]


def test_progress_bars_are_not_what_a_command_says(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text("\r  0%|   | 0/3\r 50%|##  | 1/3\ninterrupted\n")
    assert last_lines(log) == "interrupted"


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_real_commands_give_the_same_results(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(InterruptionsConfig(count=1, commands=(name,), out=tmp_path))
    assert (
        "0 with other results, 0 that could not go on, 0 hangs, 0 not answered in one line" in capsys.readouterr().out
    )
