"""One drive as recorders of all conventions log it: each combination is read right, or it is said what is open."""

import itertools

import numpy as np
import pandas as pd
import pytest
from importing_bench import rows

pytest.importorskip("pyproj", reason="positions are an extra: pip install 'drift_drake[gps]'")

from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.guess import guessed_mapping
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.known import is_path_only
from drift_drake.gap.logs.importing.mapping import InvalidMappingError, mapping_from_dict

D = rows(noise=0.5, seed=2)  # x is the east, y the north
COURSE, METRES = D["psi"] + D["beta"], 6.371e6 * np.pi / 180.0
POSITIONS = {
    "none": {},
    "x east, y north": {"x": D["x"], "y": D["y"]},
    "x north, y east": {"x": D["y"], "y": D["x"]},
    "named": {"pos_n": D["y"], "pos_e": D["x"]},
    "UTM": {"utm_easting": D["x"] + 4e5, "utm_northing": D["y"] + 5.8e6},
    "latitude": {"latitude": 52.0 + D["y"] / METRES, "longitude": D["x"] / METRES / np.cos(np.radians(52.0))},
}
COUNTED = {
    "none": None,
    "from the east": lambda angle: angle,
    "compass": lambda angle: np.mod(0.5 * np.pi - angle, 2.0 * np.pi),
    "compass, +-pi": lambda angle: np.angle(np.exp(1j * (0.5 * np.pi - angle))),
    "from its start": lambda angle: angle - angle[0],
}
DEGREES = ("compass",)
SLIP = {"none": {}, "beta": {"sideslip": D["beta"]}, "vy": {"vy": D["v"] * np.sin(D["beta"])}}
ASKED = ("Nothing here tells", "Only its range speaks", "?")


def recorded(position, heading, name, course, side, against, slip):
    """The columns of a recorder; side, against: of the yaw rate, and of accelerations and steering relative to it."""
    out = {"time": D["t"], "yaw_rate_deg_s": side * np.degrees(D["r"]), "lat_acc": side * against * D["ay"]}
    out["steer_angle"] = side * against * D["delta_cmd"]
    out |= {key: side * values for key, values in SLIP[slip].items()}
    out |= {"vx": D["v"] * np.cos(D["beta"])} if slip == "vy" else {"speed": D["v"]}
    out |= POSITIONS[position]
    for key, counted, angle in ((name, heading, D["psi"]), ("course", course, COURSE)):
        if COUNTED[counted] is not None:
            values = COUNTED[counted](angle)
            out[key] = np.degrees(values) if counted in DEGREES or key == "course" else values
    return out


def mirrored(run):
    """Columns that are not as the drive was; of a heading next to a position, that it is not the way's."""
    names = [name for name in ("r", "ay", "delta_cmd", "beta") if run.column(name) is not None]
    wrong = [name for name in names if alike(run.column(name), np.interp(run.t, D["t"], D[name])) < 0.3]
    if run.x is None or run.psi is None:
        return wrong
    way = np.arctan2(run.y[10:] - run.y[:-10], run.x[10:] - run.x[:-10])
    off = run.psi[5:-5] + np.interp(run.t, D["t"], D["beta"])[5:-5] - way
    return [*wrong, "psi"] if abs(np.angle(np.nanmean(np.exp(1j * off)))) > 0.3 else wrong


def alike(one, other):
    seen = np.isfinite(one)
    return np.corrcoef(one[seen], other[seen])[0, 1]


def combinations():
    """With a heading, and with a course and no heading or a compass'."""
    sides, headings = ((1.0, -1.0), (1.0, -1.0)), ("yaw", "heading")
    yield from itertools.product(POSITIONS, [c for c in COUNTED if c != "none"], headings, ["none"], *sides, SLIP)
    courses = ("from the east", "compass", "compass, +-pi")
    yield from itertools.product(POSITIONS, ["none", "compass"], ["heading"], courses, *sides, ["none", "beta"])


def outcomes(tmp_path, without=()):
    """Of each combination its columns that are wrong and the remarks on them; "asked" where something is left open."""
    for chosen in combinations():
        columns = {name: values for name, values in recorded(*chosen).items() if name not in without}
        guess = guessed_mapping([Topic("", pd.DataFrame(columns))])
        if any(word in f"{guess.notes} {guess.mapping}" for word in ASKED):
            yield chosen, "asked", []
            continue
        pd.DataFrame(columns).to_csv(tmp_path / "a.csv", index=False)
        try:
            mapping = mapping_from_dict(guess.mapping)
        except InvalidMappingError:
            if not without:
                raise
            continue  # nothing gives r: it is refused
        if is_path_only(mapping):
            continue
        (run,), report = import_recordings([tmp_path / "a.csv"], mapping)
        relative = chosen[1] == "from its start"
        yield chosen, [name for name in mirrored(run) if not (name == "psi" and relative)], report.remarks


@pytest.mark.slow
def test_no_convention_is_misread_without_a_word(tmp_path):
    found = list(outcomes(tmp_path))
    asked, right = ([one for one in found if one[1] == what] for what in ("asked", []))
    print(f"{len(right)} right, {len(asked)} asked")
    assert [one for one in found if one not in asked and one not in right] == []
    assert len(right) > len(asked)


@pytest.mark.slow
def test_of_a_log_without_a_yaw_rate_the_heading_tells(tmp_path):
    """A sideslip to the other side than accelerations and steering is all that only import remarks on."""
    with_heading = [one for one in outcomes(tmp_path, ("yaw_rate_deg_s",)) if one[0][1] != "none"]
    wrong = [one for one in with_heading if one[1] not in ("asked", [])]
    assert all(
        names == ["beta"] and any("beta looks mirrored" in said for said in remarks) for _, names, remarks in wrong
    )
    assert any(names == [] for _, names, _ in with_heading)
