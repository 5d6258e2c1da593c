"""What the campaign tries: inputs of every kind that commands read, spoilt, and the commands that read them.

A trial yields the words of a command and is sent how it ended.
"""

import os
from collections.abc import Callable
from random import Random

import yaml
from campaign_cars import calibrations, identifications, replays, two_tracks
from campaign_place import QUICK, Place, Trial, dumped
from campaign_plug_ins import plug_ins
from hostile import NUMBERS, TEXTS, junk, scalar, spoilt_bytes, spoilt_table
from table_dialects import CLOCKS, drive, texts
from test_fuzz import COMMANDS, PATHS

SI = {"r": "rad/s", "v": "m/s", "delta_cmd": "rad", "ay": "m/s^2", "ax": "m/s^2", "psi": "rad", "omega_r": "m/s"}
NAMES = {
    "r": ["yaw_rate", "Gierrate", "gyro_z", "r", "/imu.angular_velocity.z", "Vitesse de lacet"],
    "v": ["speed", "Geschwindigkeit", "VehSpd", "v", "GPS Speed", "vitesse"],
    "delta_cmd": ["steering_angle", "Lenkwinkel", "delta", "SteerAng", "road wheel"],
    "ay": ["ay", "Querbeschleunigung", "LatAcc", "GForceY"],
    "ax": ["ax", "LongAcc"], "psi": ["heading", "yaw"], "omega_r": ["wheel_speed_rl", "omega_r"],
}  # fmt: skip
UNITS = [
    "",
    "rad/s",
    "deg/s",
    "°/s",
    "DEG/S",
    "m/s",
    "km/h",
    "MPH",
    "kts",
    "rad",
    "deg",
    "g",
    "m/s^2",
    "m·s⁻²",
    "%",
    "?",
    "V",
]
CLOCK_NAMES = ["time", "t", "Zeit", "timestamp", "Time [s]", "utc", "elapsed"]


def tables(rng: Random, place: Place) -> Trial:
    """A table of any dialect, looked at, imported by the mapping that was proposed, and checked."""
    columns, stride = drive(), rng.choice([1, 2, 5])
    clock = rng.choice(sorted(CLOCKS))
    table = {rng.choice(CLOCK_NAMES): [CLOCKS[clock](t) for t in columns["t"][: 300 * stride : stride]]}
    for key in rng.sample(sorted(SI), rng.randint(1, len(SI))):
        unit = SI[key] if rng.random() < 0.6 else rng.choice(UNITS)
        name = rng.choice(NAMES[key]) + rng.choice(["", f" [{unit}]", f" ({unit})", f"_{unit}", f"[{unit}]"])
        table[name] = texts(columns[key][: 300 * stride : stride])
    rows = [list(table), *[list(row) for row in zip(*table.values(), strict=True)]]
    if rng.random() < 0.2:
        rows.insert(1, ["s", *(rng.choice(UNITS) for _ in rows[0][1:])])
    if rng.random() < 0.7:
        rows = spoilt_table(rng, rows)
    separator = rng.choice([",", ",", ";", "\t", " ", "|"])
    lines = [separator.join(row) for row in rows]
    if separator != "," and rng.random() < 0.4:
        lines = [line.replace(".", ",") for line in lines]
    before = rng.choice(
        [[], [], ["# made"], ["Format,MoTeC CSV File", "Vehicle,x", ""], [rng.choice(TEXTS)] * rng.randint(1, 9)]
    )
    text = rng.choice(["\n", "\n", "\r\n", "\r"]).join([*before, *lines, ""])
    content = text.encode(rng.choice(["utf-8", "utf-8", "utf-8-sig", "utf-16", "cp1252"]), "replace")
    if rng.random() < 0.3:
        content = spoilt_bytes(rng, content)
    yield from looked_at(rng, place, place.put(rng.choice(["d.csv", "d.txt", "d", "d.CSV"]), content, "table"))


def kept_tables(rng: Random, place: Place) -> Trial:
    """An earlier trial's table, spoilt further."""
    kept = sorted((place.corpus / "table").glob("*"))
    content = rng.choice(kept).read_bytes() if kept else (place.seeds / "recording.csv").read_bytes()
    yield from looked_at(rng, place, place.put("d.csv", spoilt_bytes(rng, content), "table"))


def looked_at(rng: Random, place: Place, path: str, *more: str) -> Trial:
    ended = yield ("import", "--look", path, *more)
    if ended.code or rng.random() < 0.4:
        return
    mapping = ended.printed.replace("unit: '?'", f"unit: {rng.choice(UNITS[1:-2])}").replace("unit: ?", "unit: rad")
    ended = yield (
        "import",
        path,
        "--mapping",
        place.put("mapping.yaml", mapping.encode("utf-8", "replace")),
        "--out",
        "out",
        *more,
    )
    if not ended.code and (place.folder / "out" / "run_0.csv").exists():
        yield ("check", "out", "--workers", "1")


def recordings(rng: Random, place: Place) -> Trial:
    """A recorder's file; now and then with another format's ending."""
    start = place.start(rng, "recordings")
    content = start.read_bytes() if rng.random() < 0.05 else spoilt_bytes(rng, start.read_bytes())
    if "bag" in start.parent.name:
        for path in start.parent.iterdir():
            place.put(f"bag/{path.name}", content if path == start else path.read_bytes())
        name = "bag"
    else:
        ending = (
            start.suffix
            if rng.random() < 0.95
            else rng.choice([".csv", ".mat", ".mf4", ".h5", ".vbo", ".log", ".ld", ".gz"])
        )
        name = place.put(f"drive{ending}", content, "recordings")
    databases: tuple[str, ...] = ()
    if start.stem == "frames" or rng.random() < 0.02:
        database = (place.seeds / "frames.dbc").read_bytes()
        databases = ("--dbc", place.put("d.dbc", spoilt_bytes(rng, database) if rng.random() < 0.4 else database))
    yield from looked_at(rng, place, name, *databases)


def mappings(rng: Random, place: Place) -> Trial:
    place.put("recording.csv", (place.seeds / "recording.csv").read_bytes())
    place.put("m.yaml", place.structure(rng, "mapping"), "mapping")
    yield ("import", "recording.csv", "--mapping", "m.yaml", "--out", "out")


FUNCTIONS = ["sin", "cos", "tan", "exp", "log", "sqrt", "abs", "min", "where", "arctan2", "eval"]


def expression(rng: Random, depth: int = 4) -> str:
    """Of the mapping's columns, numbers, functions and signs; some are no expression."""
    if depth == 0 or rng.random() < 0.2:
        return rng.choice(
            ["wheel_angle", "ratio", "r", "v", "gyro", "t", "q", "pi", "", str(rng.choice(NUMBERS)), "1.5"]
        )
    one, two = expression(rng, depth - 1), expression(rng, depth - 1)
    return rng.choice(
        [
            f"{one} {rng.choice(['+', '-', '*', '/', '**', '%', '//', '<', ',', 'and', '^', '@'])} {two}",
            f"({one})",
            f"-{one}",
            f"{rng.choice(FUNCTIONS)}({one})",
            f"arctan2({one}, {two})",
            f"where({one} > 0, {one}, {two})",
            f"{one}[0]",
            f"{one}.real",
            f"({one}" * rng.choice([1, 1, 150]),
        ]
    )


def formulas(rng: Random, place: Place) -> Trial:
    data = yaml.safe_load(place.good("mapping", "full.yaml"))
    data["formulas"] = {"delta_cmd": expression(rng)} | {rng.choice(["q", "beta", "ay"]): expression(rng)}
    place.put("recording.csv", (place.seeds / "recording.csv").read_bytes())
    place.put("m.yaml", dumped(data, "mapping"), "mapping")
    yield ("import", "recording.csv", "--mapping", "m.yaml", "--out", "out")


def spoilt_log(rng: Random, place: Place) -> bytes:
    start = place.start(rng, "log").read_bytes()
    if rng.random() < 0.35:
        return spoilt_bytes(rng, start)
    rows = [line.split(",") for line in start.decode("utf-8", "replace").splitlines()]
    return "\n".join([",".join(row) for row in spoilt_table(rng, rows)] + [""]).encode("utf-8", "surrogatepass")


def logs(rng: Random, place: Place) -> Trial:
    place.put("case/run_0.csv", spoilt_log(rng, place), "log")
    if rng.random() < 0.3:
        place.put("case/import.json", place.structure(rng, "report"), "report")
    place.put("car.yaml", place.good("vehicle", "plain.yaml"))
    car = ("--vehicle", "car.yaml")
    yield rng.choice([
        ("check", "case", "--workers", "1"), ("check", "case", *car, "--workers", "1"),
        ("diagnose", "case", *car, *QUICK, "--json", "a.json", "--report", "a.html"),
        ("watch", "case/run_0.csv", *car), ("watch", "case/run_0.csv", *car, "--follow", "--idle", "0.2"),
        ("replay", "case/run_0.csv", *car, "--json", "r.json"),
        ("identify", "case", *car, "--out", "i.yaml", "--json", "i.json", "--quiet", "--effects", "steering_lag"),
        ("simulate", "case/run_0.csv", *car, "--out", "s.csv"),
        ("export", "case", "--format", rng.choice(["parquet", "mcap"]), "--out", "e"),
    ])  # fmt: skip


def vehicles(rng: Random, place: Place) -> Trial:
    place.put("car.yaml", place.structure(rng, "vehicle"), "vehicle")
    place.put("case/run_0.csv", place.good("log", "full.csv"))
    place.put("answer.json", place.good("answer", "effect.json"))
    car = ("--vehicle", "car.yaml")
    yield rng.choice([
        ("effects", *car, "--json", "-"), ("apply", "answer.json", *car, "--out", "new.yaml"),
        ("check", "case", *car, "--workers", "1"), ("simulate", "slalom", *car, "--out", "s.csv", "--duration", "1"),
        ("replay", "case/run_0.csv", *car), ("watch", "case/run_0.csv", *car), ("diagnose", "case", *car, *QUICK),
        ("export", "car.yaml", "--format", rng.choice(["commonroad", "mujoco"]), "--out", "e.xml"),
    ])  # fmt: skip


def answers(rng: Random, place: Place) -> Trial:
    place.put("car.yaml", place.good("vehicle", "plain.yaml"))
    place.put("answer.json", place.structure(rng, "answer"), "answer")
    car = ("--vehicle", "car.yaml")
    yield rng.choice(
        [
            ("apply", "answer.json", *car, "--out", "new.yaml"),
            ("apply", "answer.json", *car, "--out", "new.yaml", "--force"),
            ("plan-next", "answer.json", *car, "--out", "plan.csv"),
        ]
    )


def command_lines(rng: Random, place: Place) -> Trial:
    """Of commands whose log is none, so that nothing long begins."""
    for name, kind, seed in (("good.yaml", "vehicle", "coupe.yaml"), ("good.json", "answer", "effect.json")):
        place.put(name, place.good(kind, seed))
    place.put("file.txt", b"text\n")
    place.put("empty", b"")
    (place.folder / "folder").mkdir()
    os.mkfifo(place.folder / "pipe")
    command = rng.choice(sorted(COMMANDS))
    words = [command]
    for option in COMMANDS[command]:
        if option != "PATH" and rng.random() < 0.5:
            continue
        value = rng.choice(PATHS) if rng.random() < 0.6 or "--out" in option else str(rng.choice([junk, scalar])(rng))
        value = value.replace("\x00", "").encode("utf-8", "replace").decode()
        flag = option in ("--quiet", "--again", "--force", "--no-tolerances")
        words += [value] if option == "PATH" else [option] if flag else [option, value]
    yield tuple(word for word in words if not word.startswith(("..", "/")))


TRIALS: dict[Callable[[Random, Place], Trial], float] = {
    tables: 20,
    kept_tables: 5,
    recordings: 24,
    mappings: 10,
    formulas: 6,
    logs: 16,
    vehicles: 6,
    answers: 6,
    calibrations: 4,
    two_tracks: 4,
    identifications: 0.7,
    replays: 3,
    command_lines: 3.5,
    plug_ins: 0.5,
}
"""Each with its weight."""
