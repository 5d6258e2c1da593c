"""Presets, and one sentence for each mistake in a mapping file."""

import math

import numpy as np
import pytest
import yaml

from drift_drake.gap.logs.importing.formula import evaluate
from drift_drake.gap.logs.importing.mapping import InvalidMappingError, mapping_from_dict, presets, read_mapping

GOOD = """
clocks:
  main: {column: time, unit: ms}
  other: {column: stamp, align: {signal: gyro, against: r}}
signals:
  r: {column: yaw, unit: deg/s, frame: ned}
  v: {column: speed, unit: km/h}
  gyro: {column: g, unit: rad/s, clock: other}
  wheel_angle: {column: s, unit: deg, clock: other, between: hold}
constants: {ratio: 16}
formulas: {delta_cmd: wheel_angle / ratio}
"""


def changed(path, value):
    data = yaml.safe_load(GOOD)
    *parents, key = path.split(".")
    place = data
    for parent in parents:
        place = place[parent]
    if value is None:
        del place[key]
    else:
        place[key] = value
    return data


def test_a_mapping_is_read(tmp_path):
    (tmp_path / "mine.yaml").write_text(GOOD)
    mapping = read_mapping(tmp_path / "mine.yaml")
    assert mapping.first_clock == "main"
    assert mapping.signals["r"].clock == "main"
    assert mapping.signals["wheel_angle"].between == "hold"
    assert mapping.clocks["other"].align.search == 0.5
    assert mapping.bandwidth == math.inf


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("clocks", None, "mapping: missing 'clocks'; add a line for it"),
        ("signals", {}, "'signals' must hold"),
        ("signals.v", None, "nothing gives v; a log needs r, v and delta_cmd"),
        ("signals.r.unit", "m/s", r"signals.r.unit is 'm/s'; known are rad/s, deg/s, rpm"),
        ("signals.r.unit", None, "missing 'signals.r.unit'"),
        ("signals.r.sgn", -1, "unknown key 'signals.r.sgn'; known keys are column, unit, sign"),
        ("signals.r.sign", 2, "signals.r.sign is 2; write 1 or -1"),
        ("signals.r.offset", "much", "signals.r.offset is 'much'; give a finite number"),
        ("signals.r.frame", "enu", "signals.r.frame is 'enu'; known are iso8855, ned, sae"),
        ("signals.gyro.frame", "ned", "signals.gyro.frame is for quantities of the log; use 'sign: -1'"),
        ("signals.r.clock", "third", "signals.r.clock is 'third'; the clocks are main, other"),
        ("signals.v.radius", 0.3, r"signals.v.radius is for an omega_r in rpm or rad/s; take it out"),
        ("signals.omega_r", {"column": "w", "unit": "rpm"}, "signals.omega_r is in rpm; add the wheel's radius"),
        ("signals.wheel_angle.between", "step", "between is 'step'; known are linear, hold"),
        ("signals.r", "yaw", "'signals.r' must hold 'name: value' lines"),
        ("clocks.main", "0 Hz", "clocks.main is '0 Hz'; give the rows' rate, 0.001 Hz to 1000 kHz, as '100 Hz'"),
        ("clocks.main", "-50 Hz", "clocks.main is '-50 Hz'; give the rows' rate"),
        ("clocks.main", "10 ms", "clocks.main is '10 ms'; give the rows' rate"),
        ("clocks.main", "1e300 Hz", "clocks.main is '1e300 Hz'; give the rows' rate"),
        ("clocks.main", 100, "clocks.main is 100; give the rows' rate"),
        ("clocks.main", {"rate": "e Hz"}, "clocks.main.rate is 'e Hz'; give the rows' rate"),
        ("clocks.main", {"rate": "9 Hz", "unit": "s"}, "clocks.main has a rate, .* take out unit"),
        ("clocks.main", {"unit": "s"}, "missing 'clocks.main.column'; add a line for it, or for the rows' rate"),
        ("clocks.third", "9 Hz", "clocks.third is a rate, and no signal is read at it; take it out"),
        ("clocks.main.unit", "fortnight", "clocks.main.unit is 'fortnight'; give a unit of time"),
        ("clocks.main.regular", "often", "write true or false"),
        ("clocks.other.align.signal", "r", "align.signal is 'r'; name a signal of that clock"),
        ("clocks.other.align.against", "psi", "align.against is 'psi'; give one of r, v"),
        ("clocks.main.align", {"signal": "r", "against": "r"}, "clocks.main is the log's own"),
        ("formulas.delta_cmd", "angle / ratio", "formulas.delta_cmd reads 'angle'; known there are gyro, r, ratio"),
        ("formulas.delta_cmd", "wheel_angle /", "formulas.delta_cmd: 'wheel_angle /' is no formula"),
        ("constants.ratio", "high", "constants.ratio is 'high'"),
        ("measured_point", [1.0], r"measured_point must be \[ahead, left\]"),
        ("derive", ["jerk"], "derive must be a list of some of r, v, beta"),
        ("moving", {"shortest": 2}, "missing 'moving.speed'"),
        ("bandwidth", -1, "bandwidth is -1; give a positive number"),
        ("wheelbase", 0, "wheelbase is 0; give a positive number"),
        ("colour", "red", "unknown key 'colour'"),
    ],
)
def test_mistakes(path, value, message):
    with pytest.raises(InvalidMappingError, match=message) as caught:
        mapping_from_dict(changed(path, value))
    assert "\n" not in str(caught.value)


def test_files_that_are_none(tmp_path):
    with pytest.raises(InvalidMappingError, match=r"absent.yaml: cannot be read .* or a preset \(dart, "):
        read_mapping(tmp_path / "absent.yaml")
    (tmp_path / "a.yaml").write_text("clocks: [")
    with pytest.raises(InvalidMappingError, match="not valid YAML at line 1"):
        read_mapping(tmp_path / "a.yaml")
    (tmp_path / "b.yaml").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InvalidMappingError, match="not a text file"):
        read_mapping(tmp_path / "b.yaml")
    (tmp_path / "c.yaml").write_text("just words")
    with pytest.raises(InvalidMappingError, match="the file must hold"):
        read_mapping(tmp_path / "c.yaml")


def test_presets_are_valid():
    assert presets() == ["dart", "dart_sensors", "revs_250lm"]
    for name in presets():
        assert read_mapping(name).recorder


def test_presets_static_maps():
    mapping = read_mapping("dart")

    def quantities(steering, throttle, wheel, armed=1.0):
        values = dict(mapping.constants, steering=steering, throttle=throttle, wheel=wheel, armed=armed)
        for name, formula in mapping.formulas.items():
            values[name] = evaluate(formula, values)
        return values

    # Positive commands steer left, less far than to the right; 0.027 is straight on.
    assert quantities(1.0, 0.0, 1.0)["delta_cmd"] == pytest.approx(0.3658 * np.tanh(1.3929 * 0.973), rel=1e-9)
    assert quantities(-1.0, 0.0, 1.0)["delta_cmd"] == pytest.approx(-0.5148 * np.tanh(1.0230 * 1.027), rel=1e-9)
    assert quantities(0.027, 0.0, 1.0)["delta_cmd"] == 0.0
    force = quantities(0.0, 0.3638, 2.0)
    assert force["drive"] == pytest.approx((25.36 - 9.63) * 0.2)
    assert force["tau_cmd"] / 0.03 == pytest.approx(force["drive"] - 1.266 * np.tanh(15.332) - 1.478 + 0.448)
    assert quantities(0.0, 0.1, 2.0)["drive"] == 0.0
    assert quantities(0.0, 0.5, 2.0, armed=0.0)["drive"] == 0.0
    assert quantities(0.0, 0.0, 2.0)["tau_cmd"] < 0.0
