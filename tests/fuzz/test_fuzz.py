"""Spoilt inputs are taken or refused in one sentence; none ends in a traceback or takes for ever."""

import json
import os
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

pytest.importorskip("hypothesis", reason="fuzzing needs the extra `test`")

from fuzzing import cases, limited, tried
from hypothesis import given
from hypothesis import strategies as st
from mutations import JUNK, TEXTS, mutated, spoilt

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import read_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle
from drift_drake.cli.apply import Apply, run_apply
from drift_drake.cli.main import main
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.samples import load_samples
from drift_drake.gap.diagnosis.answers.answer import read_answer
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.freeform import FORCE_CHANNELS, FUNCTIONS
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.partial import DRIVING, partial_effects
from drift_drake.gap.estimation.prediction_constants import FACTORS
from drift_drake.gap.estimation.problem import NUISANCES
from drift_drake.gap.estimation.windows import HORIZONS, PREDICTED
from drift_drake.gap.identification.calibration import read_trust
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import read_mapping
from drift_drake.gap.logs.importing.smoothing import smooth
from drift_drake.gap.next_drive.foresight import beliefs_of

VEHICLE = VehicleParameters().to_dict() | {"tyre": "brush", "effects": {"steering_lag": 0.05, "aero_drag": 1.0}}
COUNT = len(NUISANCES)
ANSWER: dict[str, Any] = {
    "case": "a", "verdict": "effect", "causes": ["steering_lag"], "posterior": {"steering_lag": 0.9, "unknown": 0.1},
    "ambiguity": ["steering_lag"], "magnitudes": {"steering_lag": {"estimate": 0.08, "low": 0.07, "high": 0.09}},
    "where": {"states": {}, "runs": {}, "regions": []}, "reduction": {"estimate": 0.9, "low": 0.8, "high": 1.0},
    "seconds": 1.0, "tolerances": dict.fromkeys(NUISANCES[:3], 0.5), "warnings": ["w"],
    "details": {
        "tempering": 1.0, "with": {"steering_offset": 0.01}, "at_least": ["steering_lag"], "familiar": 0.8,
        "provenance": {"folder": "/a", "version": "0"},
        "beliefs": {
            "noise": [0.01] * len(CHANNELS), "used": [True] * len(CHANNELS), "process": [0.1] * len(CHANNELS),
            "tempering": 1.0, "own": {"aero_drag": 1.0},
            "hypotheses": {
                name: {"probability": p, "theta": [0.0] * n, "root": np.eye(n).tolist()}
                for name, p, n in (("none", 0.5, COUNT), ("steering_lag", 0.5, COUNT + 1))
            },
        },
    },
}  # fmt: skip
NONE = ANSWER | {
    "verdict": "none", "causes": [], "posterior": {"none": 1.0}, "magnitudes": {},
    "details": {"familiar": 0.4, "detection": {name: {"least": least, "taken_for": "unknown"} for name, least in
                                               (("friction_level", 0.1), ("mass_error", None))}},
}  # fmt: skip
UNKNOWN = ANSWER | {
    "verdict": "unknown", "causes": [], "posterior": {"unknown": 1.0},
    "details": {"nearest": {"name": "aero_drag", "removes": 0.4, "free_forces_remove": 0.9,
                            "magnitudes": {"aero_drag": {"estimate": 1.0, "low": 0.9, "high": 1.1}}}},
}  # fmt: skip
CALIBRATION: dict[str, Any] = {
    "trust": {"noise": 2.0, "process": 0.5}, "tempering": 0.1,
    "discrepancy": {
        "forces": {name: [0.1] * FUNCTIONS for name in FORCE_CHANNELS}, "offsets": {"r": 0.5}, "tempering": 0.3,
    },
}  # fmt: skip
NAMES = ("aero_drag", "steering_lag")
SCORES = len(NAMES) + len(partial_effects(NAMES))
CHANNEL_SCALES = np.ones((HORIZONS, len(PREDICTED)))
CALIBRATION_BY_PREDICTION: dict[str, Any] = {
    "normal": Normal(
        names=NAMES,
        of_kind=(),
        kind_units=np.empty(0),
        stride=0.1,
        units=np.ones(2),
        scales=CHANNEL_SCALES,
        precision=np.eye(CHANNEL_SCALES.size),
        standard=np.ones((2, len(DRIVING))),
        lost=np.array([[6.0, 1.0], [1.0, 1.0]]),
        covariance=np.eye(SCORES),
        information=np.ones(SCORES),
        ratio=1.0,
        expected=np.zeros(SCORES),
        left_open=np.eye(SCORES),
        least_deviations=np.ones(2),
        factors=np.log(np.full(len(FACTORS), 1.0 / len(FACTORS))),
        scale=1.0,
        slipping=-3.0,
        left_out=np.ones(3),
        left_out_none=0.5 * np.ones(3),
        covered=np.ones(4),
        unknown=np.eye(2),
        recording=np.eye(2),
        offset=0.0 * CHANNEL_SCALES,
        level=CHANNEL_SCALES,
        noise=np.zeros((3, 5)),
    ).as_data(),
}
MAPPING = yaml.safe_load("""
clocks: {main: {column: time, unit: ms}, other: {column: stamp, align: {signal: gyro, against: r}}}
signals:
  r: {column: yaw, unit: deg/s, frame: ned}
  v: {column: speed, unit: km/h}
  gyro: {column: g, unit: rad/s, clock: other}
  wheel_angle: {column: s, unit: deg, clock: other, between: hold}
constants: {ratio: 16}
formulas: {delta_cmd: wheel_angle / ratio}
moving: {speed: 1.0}
""")
CHECKPOINT = Path(str(files("drift_drake") / "data" / "bayesian_model.npz"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Good files, to be read with spoilt ones."""
    folder = tmp_path_factory.mktemp("fuzz")
    (folder / "good.yaml").write_text(yaml.safe_dump(VEHICLE))
    (folder / "good.json").write_text(json.dumps(ANSWER))
    (folder / "file.txt").write_text("text\n")
    (folder / "empty").write_text("")
    (folder / "folder").mkdir()
    os.mkfifo(folder / "pipe")
    t = np.arange(0.0, 4.0, 0.02)
    wave = 30.0 * np.sin(3.0 * t)
    rows = np.column_stack([1e3 * t, wave, 40.0 + 0.0 * t, t, -np.deg2rad(wave), 10.0 * wave])
    np.savetxt(folder / "recording.csv", rows, delimiter=",", header="time,yaw,speed,stamp,g,s", comments="")
    smooth(t, wave)  # what is compiled on first use takes its time before the limit counts
    return folder


def log_text() -> str:
    rows = [f"{0.01 * k:.2f},{0.1 * np.sin(k):.4f},{12.0 + 0.01 * k:.3f},0.05,100\n" for k in range(60)]
    return "t,r,v,delta_cmd,tau_cmd\n" + "".join(rows)


def as_yaml(data: Any) -> bytes:
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True).encode("utf-8", "surrogatepass")


def as_json(data: Any) -> bytes:
    return json.dumps(data).encode("utf-8", "surrogatepass")


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def either(good: Any, encode: Any) -> st.SearchStrategy[bytes]:
    """A file spoilt in its structure or in its bytes."""
    return st.one_of(mutated(good, 1).map(encode), mutated(good).map(encode), spoilt(encode(good)))


@cases(0.2)
@given(content=either(VEHICLE, as_yaml))
def test_vehicles(folder: Path, content: bytes) -> None:
    path = written(folder / "vehicle.yaml", content)
    out = folder / "corrected.yaml"
    tried("vehicles", run_apply, Apply(folder / "good.json", path, out))
    if out.exists():
        read_vehicle(out)
        out.unlink()


@cases(0.2)
@given(content=st.one_of(*(either(answer, as_json) for answer in (ANSWER, NONE, UNKNOWN))))
def test_answers(folder: Path, content: bytes) -> None:
    path = written(folder / "answer.json", content)
    out = folder / "corrected.yaml"
    tried("answers", run_apply, Apply(path, folder / "good.yaml", out))
    if out.exists():
        read_vehicle(out)
        out.unlink()
        read_answer(path).sentence()


@cases(0.1)
@given(beliefs=mutated(ANSWER["details"]["beliefs"], 1))
def test_beliefs(folder: Path, beliefs: Any) -> None:
    path = written(folder / "answer.json", as_json(ANSWER | {"details": {"beliefs": beliefs}}))
    tried("beliefs", lambda: beliefs_of(read_answer(path)))


@cases(0.1)
@given(content=either(CALIBRATION, as_json))
def test_calibrations(folder: Path, content: bytes) -> None:
    tried("calibrations", read_trust, written(folder / "calibration.json", content))


@cases(0.05)
@given(content=either(CALIBRATION_BY_PREDICTION, as_json))
def test_calibrations_by_prediction(folder: Path, content: bytes) -> None:
    trust = tried("calibrations by prediction", read_trust, written(folder / "calibration.json", content))
    if trust is not None and trust.normal is not None:
        normal = trust.normal
        assert all(name in CATALOGUE for name in normal.names)
        assert np.linalg.eigvalsh(normal.precision).min() > 0.0
        assert min(normal.units.min(), normal.scales.min(), normal.blocks) > 0.0


@cases(0.1)
@given(content=spoilt(CHECKPOINT.read_bytes()))
def test_checkpoints(folder: Path, content: bytes) -> None:
    path = written(folder / "model.npz", content)
    model = tried("checkpoints", load_model, path)
    if model is not None:
        assert np.isfinite(model.prior().covariance).all()
    tried("samples", load_samples, path)


@cases(0.02)
@given(data=st.data())
def test_arrays_of_checkpoints(folder: Path, data: st.DataObject) -> None:
    with np.load(CHECKPOINT) as stored:
        arrays = {name: stored[name] for name in stored.files}
    name = data.draw(st.sampled_from(sorted(arrays)))
    kind = data.draw(st.sampled_from(["nan", "shape", "number", "text", "missing", "huge"]))
    array = arrays[name]
    if kind == "missing":
        del arrays[name]
    elif kind in ("nan", "huge") and array.dtype.kind == "f" and array.size:
        arrays[name] = array.copy()
        arrays[name].flat[data.draw(st.integers(0, array.size - 1))] = np.nan if kind == "nan" else 1e30
    else:
        junk = {"shape": array.reshape(-1)[:-1], "number": np.float64(data.draw(st.floats())), "text": np.array("x")}
        arrays[name] = junk.get(kind, np.zeros(0))
    np.savez(folder / "arrays.npz", **arrays)
    tried("arrays", load_model, folder / "arrays.npz")


@cases(0.1)
@given(content=either(MAPPING, as_yaml))
def test_mappings(folder: Path, content: bytes) -> None:
    path = written(folder / "mapping.yaml", content)
    mapping = tried("mappings", read_mapping, path)
    if mapping is not None:
        tried("imports", import_recordings, [folder / "recording.csv"], mapping)


@cases(0.1)
@given(content=spoilt(log_text().encode()))
def test_logs(folder: Path, content: bytes) -> None:
    tried("logs", read_run, written(folder / "run_0.csv", content))


COMMANDS = {
    "init": ["PATH"],
    "check": ["PATH", "--vehicle", "--calibration", "--json", "--workers"],
    "watch": ["PATH", "--vehicle", "--json", "--idle"],
    "fleet": ["PATH", "--vehicle", "--json", "--picture", "--workers"],
    "export": ["PATH", "--format", "--out"],
    "effects": ["--vehicle", "--json"],
    "import": ["PATH", "--mapping", "--out", "--start", "--end", "--json"],
    "diagnose": ["PATH", "--vehicle", "--json", "--report", "--process-scale", "--noise-scale", "--tempering",
                 "--calibration", "--workers", "--quiet", "--again"],
    "identify": ["PATH", "--vehicle", "--out", "--json", "--report", "--known", "--effects", "--quiet"],
    "plan-next": ["PATH", "--vehicle", "--out", "--v-start", "--v-end", "--half-width"],
    "apply": ["PATH", "--vehicle", "--out", "--no-tolerances", "--force"],
    "simulate": ["PATH", "--vehicle", "--out", "--seed", "--noise", "--duration", "--speed", "--steering", "--json"],
    "replay": ["PATH", "--vehicle", "--corrected", "--restart", "--html", "--json"],
}  # fmt: skip
PATHS = ["good.yaml", "good.json", "file.txt", "empty", "folder", "pipe", "nothing", "folder/new", "file.txt/x", ""]


@cases(0.08)
@given(data=st.data())
def test_command_lines(folder: Path, data: st.DataObject, capsys: pytest.CaptureFixture[str]) -> None:
    """Of commands whose log is none, so that nothing long begins."""
    name = data.draw(st.sampled_from(sorted(COMMANDS)))
    paths = st.sampled_from(PATHS).map(lambda path: str(folder / path))
    arguments = [name]
    for option in COMMANDS[name]:
        if option != "PATH" and data.draw(st.booleans()):
            continue
        value = data.draw(st.one_of(paths, JUNK.map(str), TEXTS) if option != "--vehicle" else paths)
        if option.startswith("--out") and not value.startswith(str(folder)):
            value = str(folder / "out")
        arguments += [value] if option == "PATH" else [option, value]
        if option in ("--quiet", "--again", "--force", "--no-tolerances"):
            arguments.pop()
    safe = [a for a in arguments if not (a.startswith(("..", "/")) and not a.startswith(str(folder)))]
    before = {path: (folder / path).read_bytes() for path in ("good.yaml", "good.json")}

    def command() -> None:
        try:
            code = main(safe)
        except SystemExit as end:
            code = int(str(end.code))
        assert code in (0, 2)

    with limited():
        here = Path.cwd()
        os.chdir(folder)
        try:
            tried("command lines", command)
        finally:
            os.chdir(here)
    said = capsys.readouterr().err
    assert "Traceback" not in said
    for path, content in before.items():
        (folder / path).write_bytes(content)
