"""The pages' console snippets that need logs, run on the shipped sample log: quick ones always, whole pages slowly."""

import json
import re
import shlex
import shutil
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from test_snippets import PAGES, ROOT, blocks, commands, names

from drift_drake.cli.demo import SAMPLE_LOG
from drift_drake.cli.main import main

DAYS = ("monday", "tuesday", "sunday", "day_one")
QUICK = ("check", "apply", "replay", "import", "effects")
# Pages whose commands need recordings, drives or a simulator that are not shipped.
ELSEWHERE = ("results.md", "own_simulator.md")
EPOCH, RATIO = 1.7e9, 14.5  # of the page on own logs
ANSWER = {
    "case": "monday", "verdict": "effect", "causes": ["front_stiffness_error"], "seconds": 1.0,
    "posterior": {"front_stiffness_error": 1.0}, "ambiguity": ["front_stiffness_error"],
    "magnitudes": {"front_stiffness_error": {"estimate": 0.31, "low": 0.3, "high": 0.32}},
    "where": {"states": {}, "runs": {}, "regions": []},
    "reduction": {"estimate": 0.9, "low": 0.8, "high": 1.0},
}  # fmt: skip


def console(page):
    """Words of the page's commands that no other test runs and that need no cluster."""
    shown = [text for marked, language, text in blocks(page) if language in ("console", "") and not marked]
    return [words for text in shown for words in commands(text) if "SCHEDULER" not in shlex.join(words)]


def quick():
    """Each of them once, as a test's parameter."""
    found = {shlex.join(words): words for page in PAGES for words in console(page) if page.name not in ELSEWHERE}
    watched = [text for text in found if text.startswith("watch") and "--calibration" not in text]
    chosen = [text for text in found if text.split()[0] in QUICK or text in watched]
    return [pytest.param(found[text], id=text) for text in chosen]


def write_lap(folder):
    """The recording of the page on own logs, with the topics and units of its mapping."""
    writer_of = pytest.importorskip("mcap.writer", reason="MCAP is an extra: pip install 'drift_drake[formats]'").Writer
    table = pd.read_csv(folder / "logs" / "monday" / "run_0.csv")
    with (folder / "lap.mcap").open("wb") as stream:
        writer = writer_of(stream)
        writer.start()
        schema = writer.register_schema(name="any", encoding="jsonschema", data=b'{"type": "object"}')
        channels = {
            topic: writer.register_channel(topic=topic, message_encoding="json", schema_id=schema)
            for topic in ("/imu", "/drive")
        }
        for row in table.itertuples():
            nanoseconds = int((EPOCH + row.t) * 1e9)
            stamp = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
            imu = {"header": {"stamp": stamp}, "angular_velocity": {"z": row.r}, "linear_acceleration": {"y": row.ay}}
            drive = {"speed": 3.6 * row.v, "steering_wheel": np.degrees(row.delta_cmd) * RATIO}
            for topic, message in (("/imu", imu), ("/drive", drive)):
                data = json.dumps(message).encode()
                writer.add_message(channels[topic], log_time=nanoseconds, publish_time=nanoseconds, data=data)
        writer.finish()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the pages' commands find: vehicle files, days of the sample log, a recording and its mapping, an answer."""
    folder = tmp_path_factory.mktemp("pages")
    assert main(["init", str(folder / "car.yaml")]) == 0
    for name in ("start", "roadster", "corrected"):
        shutil.copy(folder / "car.yaml", folder / f"{name}.yaml")
    for day in DAYS:
        (folder / "logs" / day).mkdir(parents=True)
        for path in sorted(SAMPLE_LOG.iterdir()):
            if path.name.endswith(".csv.gz"):
                out = folder / "logs" / day / path.name.removesuffix(".gz")
                pd.read_csv(path, compression="gzip").to_csv(out, index=False)
    shutil.copytree(folder / "logs" / "monday", folder / "cases" / "a")
    shutil.copytree(folder / "logs" / "monday", folder / "cases" / "b")
    (folder / "answer.json").write_text(json.dumps(ANSWER))
    page = next(page for page in PAGES if page.name == "own_logs.md")
    (folder / "mine.yaml").write_text(next(text for _, language, text in blocks(page) if language == "yaml"))
    write_lap(folder)
    return folder


def run(words, folder):
    """As a user in the folder would, a resting log waited for less."""
    words = re.sub(r"--idle \d+", "--idle 0.2", shlex.join(words))
    if "logs/live.csv" in words:
        shutil.copy(folder / "logs" / "monday" / "run_0.csv", folder / "logs" / "live.csv")
    if words.startswith("import") and "--out logs/monday" in words:
        shutil.rmtree(folder / "logs" / "monday")
    return main(shlex.split(words))


@pytest.mark.parametrize("words", quick())
def test_quick_commands_run(words, folder, tmp_path, monkeypatch, capsys):
    shutil.copytree(folder, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    assert run(words, tmp_path / "here") == 0, capsys.readouterr().err


@pytest.mark.skipif(shutil.which("bash") is None, reason="completion is for bash and zsh")
def test_commands_and_options_are_completed():
    snippet = (ROOT / "examples" / "completion.bash").read_text(encoding="utf-8")
    script = f"""drift-drake() {{ {shlex.quote(sys.executable)} -m drift_drake "$@"; }}
{snippet}
for words in "drift-drake diag" "drift-drake diagnose logs --vehi"; do
    COMP_WORDS=($words) COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _drift_drake; echo "${{COMPREPLY[@]}}"
done"""
    done = subprocess.run(["bash", "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["diagnose", "--vehicle"], done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in PAGES if console(p) and p.name not in ELSEWHERE], ids=names)
def test_a_pages_commands_run_one_after_the_other(page, folder, tmp_path, monkeypatch, capsys):
    shutil.copytree(folder, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    for words in console(page):
        assert run(words, tmp_path / "here") == 0, f"{shlex.join(words)}: {capsys.readouterr().err}"
