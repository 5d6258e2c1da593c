"""Mapping files: which column of a recorder's table is what, in which unit, sign, frame and clock. YAML, validated."""

import dataclasses
import math
from importlib import resources
from pathlib import Path
from typing import Any

from drift_drake.car.log.table import COLUMNS
from drift_drake.common.errors import DriftDrakeError, shown
from drift_drake.common.plain_files import LARGEST_YAML, parse_yaml, read_text
from drift_drake.common.units import DIMENSIONS, PACKED, hertz, unit_of
from drift_drake.gap.logs.importing.formula import InvalidFormulaError, names_in
from drift_drake.gap.logs.importing.known import (
    derived_quantities,
    is_captured,
    is_path_only,
    missing_quantities,
    wrong_position,
)
from drift_drake.gap.logs.wording.conversion import FRAMES, QUANTITIES, dimensions_of, units_of

DERIVABLE = ("r", "v", "beta", "ax", "ay")
BETWEEN = ("linear", "hold")
EPOCHS = ("auto", "shared", "own")


class InvalidMappingError(DriftDrakeError, ValueError):
    """A mapping file that cannot be used; the message names the file, the key and the remedy."""


@dataclasses.dataclass(frozen=True)
class Align:
    """Which signal of this clock to correlate with which motion (a quantity of the first clock) to find its offset."""

    signal: str
    against: str
    search: float = 0.5  # [s] about the offset that the rows suggest


@dataclasses.dataclass(frozen=True)
class Clock:
    """A column of times. The first clock of a mapping is the log's. `unit`: of time, or `hhmmss` (of packed digits).

    Of a table without times `rate` [Hz] in place of `column`: row k of its signals' topic is read at k / rate.

    A reading is taken wherever the clock ticks: a recorder that repeats slow columns in fast rows repeats their clock
    too. Another clock's offset is `offset` where it is known. Else clocks of several topics, and clocks with absolute
    stamps, share their epoch, and of two other clocks in one table reading and row are taken as simultaneous; `epoch`
    (shared, own) says otherwise. `align` refines the offset from the data.
    """

    column: str = ""
    unit: str = "s"
    regular: bool = False  # readings are taken at a fixed rate; the times are those of arrival, and jitter
    blank: float | None = None  # a time that stands for "no reading yet"
    offset: float | None = None  # [s] to add to read the first clock
    epoch: str = "auto"
    align: Align | None = None
    rate: float | None = None

    @property
    def label(self) -> str:
        """What messages call it: its column, or its rate."""
        return self.column if self.rate is None else f"{self.rate:g} Hz"


@dataclasses.dataclass(frozen=True)
class Signal:
    """One column: SI value = sign * scale * (column in SI units), turned into ISO 8855, plus `offset` [SI, ISO 8855].

    `radius` [m] turns a wheel's angular rate (rpm, rad/s) into the rim's speed. `between` readings of a slow clock a
    value runs on a line, or holds.
    """

    column: str
    unit: str
    sign: float = 1.0
    scale: float = 1.0
    offset: float = 0.0
    frame: str | None = None
    clock: str = ""
    between: str = "linear"
    radius: float | None = None


@dataclasses.dataclass(frozen=True)
class Moving:
    """Stretches to keep: above `speed` [m/s], for at least `shortest` [s]. The rest (standing, carried) is cut."""

    speed: float
    shortest: float = 3.0


@dataclasses.dataclass(frozen=True)
class RecorderMapping:
    """A mapping file. `measured_point` [m]: ahead and to the left of the centre of gravity, where x, y, vx, vy are
    measured; `derive`: what to compute from x, y, psi (motion capture) where no column gives it; `formulas`: further
    quantities, in order, from signals, derived quantities, `constants` and earlier formulas; `bandwidth` [Hz]:
    of the vehicle's motion at most, faster things in motion capture are vibration and taken for noise; `trust`: columns
    of the log to take as they are, however large."""

    clocks: dict[str, Clock]
    signals: dict[str, Signal]
    recorder: str = ""
    frame: str = "iso8855"
    measured_point: tuple[float, float] = (0.0, 0.0)
    wheelbase: float | None = None
    derive: tuple[str, ...] = ("r", "v", "beta")
    constants: dict[str, float] = dataclasses.field(default_factory=dict)
    formulas: dict[str, str] = dataclasses.field(default_factory=dict)
    bandwidth: float = math.inf
    moving: Moving | None = None
    trust: tuple[str, ...] = ()

    @property
    def first_clock(self) -> str:
        """Name of the log's clock."""
        return next(iter(self.clocks))


def presets() -> list[str]:
    """Names of the mappings that come with the package, one a recorder."""
    folder = resources.files("drift_drake.gap.logs.importing") / "presets"
    return sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def read_mapping(name: str | Path) -> RecorderMapping:
    """The preset of that name, or else the mapping file of that path.

    Raises:
        InvalidMappingError: names the file, the key and the remedy.
    """
    if str(name) in presets():
        file = resources.files("drift_drake.gap.logs.importing") / "presets" / f"{name}.yaml"
        text, source = file.read_text(encoding="utf-8"), f"preset {name}"
    else:
        source, remedy = str(name), f"give a mapping file in YAML or a preset ({', '.join(presets())})"
        text = read_text(name, InvalidMappingError, remedy, LARGEST_YAML)
    data = parse_yaml(text, InvalidMappingError, source, "write 'name: value' lines")
    return mapping_from_dict(data, source)


def mapping_from_dict(data: Any, source: str = "mapping") -> RecorderMapping:
    """A mapping from plain data.

    Raises:
        InvalidMappingError: names `source`, the key and the remedy.
    """
    try:
        mapping = _mapping(data)
        _check_names(mapping)
    except InvalidMappingError as error:
        raise InvalidMappingError(f"{source}: {error}") from None
    return mapping


def _mapping(data: Any) -> RecorderMapping:
    entries = _entries(data, RecorderMapping, "")
    for key in ("clocks", "signals", "constants", "formulas"):
        named = entries.get(key, {})
        if key in ("clocks", "signals") and (not isinstance(named, dict) or not named):
            raise InvalidMappingError(f"'{key}' must hold one 'name: {{column: ..., unit: ...}}' line each")
        if not isinstance(named, dict):
            raise InvalidMappingError(f"'{key}' must hold 'name: value' lines")
        for name in named:
            if not isinstance(name, str):
                raise InvalidMappingError(f"the name {shown(name)} in '{key}' is no text; put it in quotes")
    clocks = {name: _clock(item, f"clocks.{name}") for name, item in entries["clocks"].items()}
    first = next(iter(clocks))
    signals = {name: _signal(name, item, first) for name, item in entries["signals"].items()}
    constants = {k: _number(v, f"constants.{k}") for k, v in entries.get("constants", {}).items()}
    point = entries.get("measured_point", (0.0, 0.0))
    if not isinstance(point, (list, tuple)) or len(point) != 2:
        raise InvalidMappingError("measured_point must be [ahead, left] of the centre of gravity, in metres")
    for key, known in (("derive", DERIVABLE), ("trust", COLUMNS)):
        names = entries.get(key, ())
        if not isinstance(names, (list, tuple)) or not all(name in known for name in names):
            raise InvalidMappingError(f"{key} must be a list of some of {', '.join(known)}")
    moving = None
    if entries.get("moving") is not None:
        given = _entries(entries["moving"], Moving, "moving.")
        moving = Moving(**{name: _number(q, f"moving.{name}", positive=True) for name, q in given.items()})
    wheelbase, bandwidth = entries.get("wheelbase"), math.inf
    if "bandwidth" in entries:
        bandwidth = _number(entries["bandwidth"], "bandwidth", positive=True)
    return RecorderMapping(
        clocks=clocks,
        signals=signals,
        recorder=str(entries.get("recorder", "")),
        frame=_choice(entries.get("frame", "iso8855"), FRAMES, "frame"),
        measured_point=(_number(point[0], "measured_point"), _number(point[1], "measured_point")),
        wheelbase=None if wheelbase is None else _number(wheelbase, "wheelbase", positive=True),
        derive=tuple(entries.get("derive", RecorderMapping.derive)),
        constants=constants,
        formulas={key: str(value) for key, value in entries.get("formulas", {}).items()},
        bandwidth=bandwidth,
        moving=moving,
        trust=tuple(entries.get("trust", ())),
    )


def _entries(data: Any, kind: Any, prefix: str) -> dict[str, Any]:
    fields = {field.name: field for field in dataclasses.fields(kind)}
    if not isinstance(data, dict):
        where = f"'{prefix.rstrip('.')}'" if prefix else "the file"
        raise InvalidMappingError(f"{where} must hold 'name: value' lines ({', '.join(fields)})")
    for key in data:
        if key not in fields:
            raise InvalidMappingError(f"unknown key '{prefix}{str(key)[:60]}'; known keys are {', '.join(fields)}")
    for name, field in fields.items():
        needed = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        if needed and name not in data:
            raise InvalidMappingError(f"missing '{prefix}{name}'; add a line for it")
    return data


def _texts(entries: dict[str, Any], names: tuple[str, ...], prefix: str) -> None:
    for name in names:
        if not isinstance(entries.get(name, ""), str):
            raise InvalidMappingError(f"{prefix}{name} is {shown(entries[name])}; give a name, in quotes")


def _number(value: Any, key: str, positive: bool = False) -> float:
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number) or (positive and number <= 0.0):
        kind = "a positive" if positive else "a finite"
        raise InvalidMappingError(f"{key} is {shown(value)}; give {kind} number")
    return number


def _choice(value: Any, known: tuple[str, ...] | list[str], key: str) -> str:
    if not isinstance(value, str) or value not in known:
        raise InvalidMappingError(f"{key} is {shown(value)}; known are {', '.join(known)}")
    return str(value)


def _clock(data: Any, key: str) -> Clock:
    short = not isinstance(data, dict)
    entries = {"rate": data} if short else dict(_entries(data, Clock, f"{key}."))
    if "rate" in entries:
        if extra := sorted({"column", "unit", "regular", "blank"} & set(entries)):
            raise InvalidMappingError(f"{key} has a rate, which gives its times; take out {', '.join(extra)}")
        if not 1e-3 <= (rate := hertz(entries["rate"])) <= 1e6:
            said = f"{key if short else f'{key}.rate'} is {shown(entries['rate'])}"
            raise InvalidMappingError(f"{said}; give the rows' rate, 0.001 Hz to 1000 kHz, as '100 Hz'")
        entries["rate"] = rate
    elif "column" not in entries:
        raise InvalidMappingError(f"missing '{key}.column'; add a line for it, or for the rows' rate")
    _texts(entries, ("column",), f"{key}.")
    if entries.get("column") == "?":
        like = f"{key.split('.', 1)[1]}: 100 Hz"
        raise InvalidMappingError(f"{key}.column is '?'; name the column of times, or write the rows' rate: '{like}'")
    unit = entries.get("unit", "s")
    if not isinstance(unit, str) or (unit not in PACKED and unit_of(unit, ("time",)) is None):
        units = ", ".join([*DIMENSIONS["time"][1], *PACKED])
        raise InvalidMappingError(f"{key}.unit is {shown(unit)}; give a unit of time: {units}")
    for name in ("blank", "offset"):
        if entries.get(name) is not None:
            entries[name] = _number(entries[name], f"{key}.{name}")
    _choice(entries.get("epoch", "auto"), EPOCHS, f"{key}.epoch")
    if not isinstance(entries.get("regular", False), bool):
        raise InvalidMappingError(f"{key}.regular is {shown(entries['regular'])}; write true or false")
    if entries.get("align") is not None:
        align = dict(_entries(entries["align"], Align, f"{key}.align."))
        _texts(align, ("signal", "against"), f"{key}.align.")
        align["search"] = _number(align.get("search", Align.search), f"{key}.align.search", positive=True)
        entries["align"] = Align(**align)
    return Clock(**entries)


def _signal(name: str, data: Any, first_clock: str) -> Signal:
    key = f"signals.{name}"
    entries = {"clock": first_clock, **_entries(data, Signal, f"{key}.")}
    _texts(entries, ("column", "clock"), f"{key}.")
    unit = entries["unit"]
    if not isinstance(unit, str) or (known := unit_of(unit, dimensions_of(name))) is None:
        asked = "write the recorder's unit; known" if unit == "?" else "known"
        raise InvalidMappingError(f"{key}.unit is {shown(unit)}; {asked} are {', '.join(units_of(name))}")
    for number in ("sign", "scale", "offset"):
        if number in entries:
            entries[number] = _number(entries[number], f"{key}.{number}")
    if entries.get("sign", 1.0) not in (1.0, -1.0):
        raise InvalidMappingError(f"{key}.sign is {entries['sign']:g}; write 1 or -1 (scale is for factors)")
    if entries.get("frame") is not None:
        _choice(entries["frame"], FRAMES, f"{key}.frame")
        if name not in QUANTITIES:
            raise InvalidMappingError(f"{key}.frame is for quantities of the log; use 'sign: -1' for '{name}'")
    _choice(entries.get("between", "linear"), BETWEEN, f"{key}.between")
    turns = name == "omega_r" and known.dimension == "angular rate"
    if turns and entries.get("radius") is None:
        raise InvalidMappingError(f"{key} is in {entries['unit']}; add the wheel's radius in metres")
    if entries.get("radius") is not None:
        entries["radius"] = _number(entries["radius"], f"{key}.radius", positive=True)
        if not turns:
            raise InvalidMappingError(f"{key}.radius is for an omega_r in rpm or rad/s; take it out")
    return Signal(**entries)


def _check_names(mapping: RecorderMapping) -> None:
    signals, first = mapping.signals, mapping.first_clock
    for name, signal in signals.items():
        if signal.clock not in mapping.clocks:
            raise InvalidMappingError(
                f"signals.{name}.clock is '{signal.clock}'; the clocks are {', '.join(mapping.clocks)}"
            )
    for name, clock in mapping.clocks.items():
        if clock.rate is not None and all(signal.clock != name for signal in signals.values()):
            raise InvalidMappingError(f"clocks.{name} is a rate, and no signal is read at it; take it out")
    if (wrong := wrong_position(mapping)) is not None:
        raise InvalidMappingError(wrong)
    captured, derived = is_captured(mapping), derived_quantities(mapping)
    known = set(signals) | derived | set(mapping.constants)
    for name, formula in mapping.formulas.items():
        try:
            unknown = sorted(names_in(formula) - known)
        except InvalidFormulaError as error:
            raise InvalidMappingError(f"formulas.{name}: {error}") from None
        if unknown:
            raise InvalidMappingError(
                f"formulas.{name} reads '{unknown[0]}'; known there are {', '.join(sorted(known))}"
            )
        known.add(name)
    for name, clock in mapping.clocks.items():
        if clock.align is None:
            continue
        if name == first:
            raise InvalidMappingError(f"clocks.{name} is the log's own; align the other clocks with it")
        if clock.align.signal not in signals or signals[clock.align.signal].clock != name:
            raise InvalidMappingError(
                f"clocks.{name}.align.signal is '{clock.align.signal}'; name a signal of that clock"
            )
        here = {key for key, signal in signals.items() if signal.clock == first}
        apart = {"vx", "vy", "r"} & (set(signals) - here)
        away = {"v", "beta"} if apart and not captured else set()  # known only once the clocks are one
        motion = (derived - away) | here
        if clock.align.against not in motion & set(QUANTITIES):
            raise InvalidMappingError(
                f"clocks.{name}.align.against is '{clock.align.against}'; "
                f"give one of {', '.join(sorted(motion & set(QUANTITIES)))}"
            )
    missing = missing_quantities(mapping)
    if missing and not is_path_only(mapping):
        raise InvalidMappingError(
            f"nothing gives {', '.join(missing)}; a log needs r, v and delta_cmd "
            "(map columns, derive them from x, y, psi, or write formulas)"
        )
