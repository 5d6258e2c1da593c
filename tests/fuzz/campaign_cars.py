"""What the campaign tries of cars of both kinds: their files, their calibrations, answers to them, and replays."""

from random import Random

from campaign_place import QUICK, Place, Trial
from hostile import scalar

GOOD_CARS = {"vehicle": "plain.yaml", "two_track": "coupe.yaml"}
LONGEST_FIT = 100.0  # [s] of processor time that a calibration may take


def car_of(rng: Random, place: Place, spoilt: float = 0.5) -> tuple[str, str]:
    """Option and name of a car's file, of either kind; as often as `spoilt` a spoilt one."""
    kind = rng.choice(sorted(GOOD_CARS))
    if rng.random() < spoilt:
        return "--vehicle", place.put("car.yaml", place.structure(rng, kind), kind)
    return "--vehicle", place.put("car.yaml", place.good(kind, GOOD_CARS[kind]))


def calibrations(rng: Random, place: Place) -> Trial:
    """A calibration, spoilt, of the car it belongs to or of one of the other kind."""
    car = car_of(rng, place, 0.1)
    place.put("case/run_0.csv", place.good("log", rng.choice(["full.csv", "long.csv"])))
    if rng.random() < 0.1:
        place.put("case/run_1.csv", place.good("log", "few.csv"))
    place.put("c.json", place.structure(rng, "calibration"), "calibration")
    command = rng.choice(["check", "diagnose", "diagnose", "watch"])
    more = {
        "check": ("--workers", "1"),
        "diagnose": (*QUICK, "--json", "a.json", *rng.choice([(), ("--report", "a.html")])),
        "watch": (),
    }[command]
    yield (command, "case/run_0.csv" if command == "watch" else "case", *car, "--calibration", "c.json", *more)


def two_tracks(rng: Random, place: Place) -> Trial:
    """A double-track car's file, spoilt, and what takes one, or does not."""
    car = ("--vehicle", place.put("car.yaml", place.structure(rng, "two_track"), "two_track"))
    place.put("case/run_0.csv", place.good("log", "full.csv"))
    answer = place.start(rng, "answer").read_bytes() if rng.random() < 0.5 else place.structure(rng, "answer")
    place.put("answer.json", answer, "answer")
    calibration = place.start(rng, "calibration").read_bytes()
    place.put("c.json", calibration)
    trusting = ("--calibration", "c.json")
    yield rng.choice([
        ("apply", "answer.json", *car, "--out", "new.yaml"),
        ("apply", "answer.json", *car, "--out", "new.yaml", "--force"),
        ("check", "case", *car, "--workers", "1"), ("check", "case", *car, *trusting, "--workers", "1"),
        ("replay", "case/run_0.csv", *car), ("diagnose", "case", *car, *QUICK),
        ("diagnose", "case", *car, *trusting, *QUICK),
        ("effects", *car), ("simulate", "slalom", *car, "--out", "s.csv"), ("watch", "case/run_0.csv", *car),
        ("plan-next", "answer.json", *car, "--out", "p.csv"), ("fleet", "case", *car, "--workers", "1"),
        ("export", "car.yaml", "--format", "mujoco", "--out", "e.xml"), ("choose", "case", *car, "--out", "c.yaml"),
    ])  # fmt: skip


def identifications(rng: Random, place: Place) -> Trial:
    """Of either kind of car, by a log that may be spoilt; the written calibration is used."""
    name = rng.choice(["full.csv", "long.csv"])
    rows = place.good("log", name).decode().splitlines()
    for _ in range(rng.choice([0, 1, 2, 20])):
        at = rng.randrange(1, len(rows))
        cells = rows[at].split(",")
        cells[rng.randrange(len(cells))] = str(scalar(rng))
        rows[at] = ",".join(cells)
    place.put("case/run_0.csv", "\n".join([*rows, ""]).encode("utf-8", "surrogatepass"), "log")
    car = car_of(rng, place)
    kind = rng.choice(["auto", "single-track", "double-track", "double-track", str(scalar(rng)).replace("\x00", "")])
    criterion = rng.choice(["prediction", "prediction", "auto", "likelihood"])
    known = rng.choice([(), ("--known", "mass"), ("--effects", "steering_lag"), ("--known", str(scalar(rng))[:20])])
    ended = yield (
        "identify", "case", *car, "--car", kind, "--criterion", criterion, *known, "--json", "i.json",
        "--out", "i.yaml", "--quiet", *rng.choice([(), ("--force",)]),
    )  # fmt: skip
    if not ended.code and (place.folder / "i.json").exists() and (place.folder / "i.yaml").exists():
        yield ("check", "case", "--vehicle", "i.yaml", "--calibration", "i.json", "--workers", "1")


def replays(rng: Random, place: Place) -> Trial:
    """With a corrected car of either kind, and restarts of any length."""
    car = car_of(rng, place, 0.3)
    corrected = place.structure(rng, rng.choice(sorted(GOOD_CARS)))
    place.put("new.yaml", corrected)
    place.put("case/run_0.csv", place.good("log", rng.choice(["full.csv", "few.csv", "long.csv"])))
    restart = ("--restart", str(rng.choice([0.1, 0.5, 1, 2, 1e9, 0, -1, "nan", "inf", "a", "1e-9", "9" * 400])))
    yield ("replay", rng.choice(["case", "case/run_0.csv"]), *car, *rng.choice([(), ("--corrected", "new.yaml")]),
           *rng.choice([(), restart]), "--json", "r.json")  # fmt: skip
