"""One drive as text tables of every dialect, unit and clock, for the tests of the importer."""

import datetime
from collections.abc import Callable, Sequence

import numpy as np
import yaml
from importing_bench import rows

from drift_drake.gap.logs.importing.look import look, mapping_text
from drift_drake.gap.logs.importing.mapping import mapping_from_dict
from drift_drake.gap.logs.importing.recording import read_recording
from drift_drake.gap.logs.wording.conversion import factor

STARTED = datetime.datetime(2024, 5, 1, 23, 59, 52, tzinfo=datetime.UTC)  # eight seconds before midnight
COUNT = 1200  # rows: twelve seconds


def drive() -> dict[str, np.ndarray]:
    """Columns of the drive [SI], a hundred rows a second."""
    return {name: values[:COUNT] for name, values in rows().items()}


def times_of_day(t: float) -> tuple[int, int, float]:
    of_day = (STARTED.hour * 3600 + STARTED.minute * 60 + STARTED.second + t) % 86400.0
    whole = round(of_day * 1000)
    return whole // 3600000 % 24, whole // 60000 % 60, whole % 60000 / 1000


def minutes(t: float) -> tuple[int, float]:
    """Minutes and seconds of a stopwatch that crosses a full hour."""
    thousandths = round(1000 * t) + 3592000
    return thousandths // 60000 % 60, thousandths % 60000 / 1000


def stamp(t: float) -> datetime.datetime:
    return STARTED + datetime.timedelta(milliseconds=round(1000 * t))


CLOCKS: dict[str, Callable[[float], str]] = {  # of a time [s]: how it is written
    "s": lambda t: f"{t:.3f}",
    "ms": lambda t: f"{1e3 * t:.0f}",
    "us": lambda t: f"{1e6 * t:.0f}",
    "min": lambda t: f"{t / 60.0:.8f}",
    "days": lambda t: f"{45413.0 + t / 86400.0:.11f}",
    "unix": lambda t: f"{STARTED.timestamp() + t:.3f}",
    "unix_ms": lambda t: f"{1e3 * (STARTED.timestamp() + t):.0f}",
    "iso": lambda t: stamp(t).strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
    "iso_zone": lambda t: stamp(t).strftime("%Y-%m-%d %H:%M:%S.%f+02:00"),
    "basic": lambda t: stamp(t).strftime("%Y%m%dT%H%M%S.%fZ"),
    "german": lambda t: stamp(t).strftime("%d.%m.%Y %H:%M:%S.%f"),
    "american": lambda t: stamp(t).strftime("%m/%d/%Y %I:%M:%S.%f %p"),
    "matlab": lambda t: stamp(t).strftime("%d-%b-%Y %H:%M:%S.%f"),
    "hms": lambda t: "{:02d}:{:02d}:{:06.3f}".format(*times_of_day(t)),
    "minutes": lambda t: "{:02d}:{:06.3f}".format(*minutes(t)),
    "packed": lambda t: "{:02d}{:02d}{:06.3f}".format(*times_of_day(t)),
    "packed_ms": lambda t: "{:02d}{:02d}{:06.3f}".format(*times_of_day(t)).replace(".", ""),
}  # fmt: skip
"""The drive crosses midnight, and (`minutes`) a full hour."""


def table(
    columns: dict[str, Sequence[str]],
    separator: str = ",",
    decimal: str = ".",
    quoted: bool = False,
    units: Sequence[str] = (),
) -> str:
    """Text of columns of texts by name; units: a row below the names."""

    def cells(texts: Sequence[str]) -> str:
        return separator.join(f'"{text}"' if quoted else text for text in texts)

    lines = [cells(list(columns)), *([cells(units)] if units else [])]
    lines += [cells([text.replace(".", decimal) if _is_number(text) else text for text in row])
              for row in zip(*columns.values(), strict=True)]  # fmt: skip
    return "\n".join(lines) + "\n"


def _is_number(text: str) -> bool:
    return text.replace(".", "", 1).lstrip("-").isdigit()


def texts(values: np.ndarray) -> list[str]:
    return [f"{value:.7f}" for value in values]


SIGNALS = ("r", "v", "ay", "delta_cmd")
NAMES = {
    "english": ("time", "yaw rate", "speed", "lateral acceleration", "road wheel angle"),
    "short": ("t", "YawRate", "VehSpd", "AccY", "SteerAng"),
    "german": ("Zeit", "Gierrate", "Geschwindigkeit", "Querbeschleunigung", "Lenkwinkel"),
    "french": ("Temps", "Vitesse de lacet", "Vitesse véhicule", "Accélération latérale", "Angle de braquage"),
}


def columns(names, units, clock="s", unit_in_name=True):
    exact = drive()
    time, *others = names
    found = {time: [CLOCKS[clock](t) for t in exact["t"]]}
    for name, key, unit in zip(others, SIGNALS, units, strict=True):
        found[f"{name} [{unit}]" if unit_in_name else name] = texts(exact[key] / factor(unit))
    return found


def assert_the_drive(path, allowed=2e-4):
    """A look's mapping, as it is printed, reads the drive."""
    found = look(path)
    recording = read_recording(path, mapping_from_dict(yaml.safe_load(mapping_text(found))))
    assert not found.missing
    exact = drive()
    for readings in recording.clocks.values():
        t = readings.t - readings.t[0]
        if len(t) == COUNT:
            np.testing.assert_allclose(t, exact["t"], atol=1e-5)
        for key, values in readings.signals.items():
            there = np.isfinite(values)
            np.testing.assert_allclose(
                values[there], np.interp(t, exact["t"], exact[key])[there], atol=allowed, err_msg=key
            )
    assert set(SIGNALS) <= {key for readings in recording.clocks.values() for key in readings.signals}
    return recording
