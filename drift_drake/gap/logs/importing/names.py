"""What a column's name says: its words, the unit in it, and which quantities of the log it may be.

A quantity's name has the words of one of its ways and no other word that speaks of anything: `yaw_rate` is a yaw rate,
`desired_yaw_rate`, `yaw_rate_offset` and `yaw_acceleration` are not. Words that are not known count against a name.
"""

import re
from collections.abc import Iterable
from typing import NamedTuple

from drift_drake.common.units import DIMENSIONS, OTHER, Unit, is_stated, meanings, unit_of
from drift_drake.gap.logs.wording.conversion import dimensions_of
from drift_drake.gap.logs.wording.vocabulary import LONGEST, WORDS, pieces, pieces_of_compound


class Rule(NamedTuple):
    """Ways to name a quantity, the best first, each a set of concepts; and what else may be said with them."""

    ways: tuple[str, ...]
    qualifiers: str


COMMON = frozenset(["source", "car", "tyre"])
SAYS = {"acceleration": "acc", "angular rate": "rate", "speed": "speed"}  # what a unit says of its column
SYMBOLS = ("x", "y", "r", "v", "t", "delta", "beta", "gee lat", "gee long", "v car")  # no unknown word with these
RULES = {
    "x": Rule(("pos x", "x"), "pos"),
    "y": Rule(("pos y", "y"), "pos"),
    "latitude": Rule(("latitude", "lat"), "pos"),
    "longitude": Rule(("longitude", "long"), "pos"),
    "course": Rule(("course",), "angle heading"),
    "r": Rule(
        ("yaw rate", "yaw speed", "heading rate", "yaw gyro", "angular z", "gyro z", "rate z", "angle speed z",
         "revs z", "r", "gyro"),
        "rate speed gyro angular angle yaw z revs",
    ),
    "psi": Rule(("orientation yaw", "yaw angle", "heading", "yaw"), "angle orientation yaw heading"),
    "vx": Rule(("speed x", "speed long", "v long", "linear x"), "linear speed x long"),
    "vy": Rule(("speed y", "speed lat", "v lat", "linear y"), "linear speed y lat"),
    "v": Rule(("speed car", "speed", "v car", "v", "speed linear norm"), "norm v"),
    "beta": Rule(("slip side", "slip angle", "beta"), "slip side angle beta"),
    "omega_r": Rule(
        ("wheel rear speed", "wheel rear revs", "revs rear", "revs r", "rear speed", "wheel speed", "wheel revs",
         "wheel rate"),
        "hand axle angular speed revs wheel rear r",
    ),
    "ax": Rule(("acc x", "acc long", "gee long"), "linear gee x long"),
    "ay": Rule(("acc y", "acc lat", "gee lat", "acc side"), "linear gee y lat"),
    "az": Rule(("acc z",), "linear gee"),
    "delta_cmd": Rule(
        ("road wheel", "delta", "steer angle", "front wheel angle", "steer", "handwheel angle", "handwheel"),
        "target wheel road front hand handwheel angle delta steer axle pos",
    ),
    "tau_cmd": Rule(("torque target", "torque"), "engine target wheel rear axle"),
    "time": Rule(("time", "t", "date time", "date"), "t date source"),
}  # fmt: skip
RECEIVERS = {"gps", "gnss"}
UNKNOWN, NUMBERED = 1.0, 0.25  # what a word that is not known, and a number, count against a name
HANDWHEEL = 1.5  # what the steering wheel counts against the road wheel
LIMIT = 4.0  # from which a column is named, and not taken
DRIVEN = 2.5  # what the wheels' speed counts against the car's, where it has to stand for it
IN_WORDS = ("mdps", "kmh", "kph", "kmph", "kmhr", "mph", "mps", "mps2", "fps", "knots", "kts", "radps", "degps", "degs",
            "dps", "rpm", "percent")  # fmt: skip
DOUBTFUL = ("min", "in", "mi", "rev", "turn", "day", "us", "u", "tr", "deg c", "revs", "tour", "no", "st")
OF_TOPICS = r"status|report|info"  # that say nothing of what a topic holds
BRACKETS = str.maketrans("（）［］【】", "()[][]")  # noqa: RUF001
EARTH = "ned"  # last letters of velocities to the north, east and down
UNCLEAR = re.compile(r"(?<![a-z])(phi|theta|φ|ϕ|θ)", re.IGNORECASE)  # of a heading, or of roll or pitch
UNCLEAR_RATES = ("rps",)  # revolutions or radians a second of a yaw rate: asked
SHORTENED = 5  # letters from which a word in front of others still speaks (`Lenkradw`, `speedfilt`)
PART = re.compile(r"[A-Z]{2,4}_(?=.*[a-z])")  # of a car, that sends the signal (`ESP_v_Signal`)
GYRO_AXIS = re.compile(r"((?:.*[^a-zA-Z])?)g_?([xyz])((?![a-zA-Z]).*)", re.IGNORECASE)
AXES = {"0": "x", "1": "y", "2": "z"}
VECTORS = {"speed", "acc", "gyro", "angular", "pos", "linear"}


class Stated(NamedTuple):
    """A unit that a file or a name states: the text, and whether it stands where only a unit stands."""

    text: str
    sure: bool


def concepts(name: str) -> tuple[set[str], int, int]:
    """What the words of a name speak of, how many are not known, and how many are numbers."""
    said: set[str] = set()
    unknown = numbers = 0
    bare, last = name, re.search(r"\[(\d)\]$", name)
    if last:
        bare = name[: last.start()]
    part = PART.match(bare)
    if part and not set(pieces(part[0])) & set(WORDS):
        bare = bare[part.end() :]
    words = pieces(bare)
    for number, word in enumerate(words):
        if word in WORDS:
            said |= set(WORDS[word])
        elif word.isdigit():
            numbers += 1
        elif len(word) == 1 and number == len(words) - 1 and word in EARTH and not words[number - 1].isdigit():
            said.add("earth")
        elif len(word) > 1 or number > 0:  # nYawRate
            unknown += 1
            said |= {concept for end in range(SHORTENED, len(word)) for concept in WORDS.get(word[:end], ())}
    if last and (said & VECTORS or "xyz" in words) and last[1] in AXES:
        said.add(AXES[last[1]])
    elif last:
        said.add("element")
    return said, unknown, numbers


def as_gyro(name: str, others: Iterable[str]) -> str:
    """`gz` next to `az` is a gyroscope's axis, which other names tell; alone it may be an acceleration in g."""
    found = GYRO_AXIS.fullmatch(name)
    if found is None:
        return name
    accelerations = re.compile(rf"{re.escape(found[1])}a(cc|ccel)?_?{found[2]}(?![a-zA-Z]).*", re.IGNORECASE)
    return f"{found[1]}gyro_{found[2]}{found[3]}" if any(map(accelerations.fullmatch, others)) else name


def parts_of_path(path: str) -> tuple[str, str]:
    """Topic and column of a path (`/imu/angular_velocity/z`): its last name, or two where the last is an axis."""
    parts = path.split("/")
    last = 2 if len(parts[-1]) == 1 and len(parts) > 2 else 1
    return "/".join(parts[:-last]), ".".join(parts[-last:])


def bracketed(name: str) -> tuple[str, Stated | None]:
    """A name without its last brackets, and the unit in them; brackets that say no unit (`W (IMU)`) stay."""
    if len(name) > LONGEST:
        return name, None
    name = re.sub(r" \(column \d+\)$", "", name).translate(BRACKETS)  # of two with one name
    found = re.search(r"\s*(\[([^\[\]]*[^\[\]\d\s][^\[\]]*)\]|\(([^()]*)\))([^\[\]()]*)$", name)
    if not found:
        return name, None
    text = (found[2] if found[2] is not None else found[3]).strip()
    square = found[2] is not None
    if not is_stated(text):
        return (name[: found.start()] + " " + found[4]).strip(), None
    words = [word for word in pieces(text) if not word.isdigit()]
    of_name = words and all(len(word) > 1 and word in WORDS for word in words)
    if of_name and not square and all(unit.dimension == OTHER for unit in meanings(text)):
        return name, None
    return (name[: found.start()] + " " + found[4]).strip(), Stated(text, True)


def suffixed(name: str, kinds: tuple[str, ...]) -> tuple[str, Stated | None]:
    """A name without the unit at its end (`speed_kmh`, `yaw_rate_deg_s`, `x_m`), and this unit."""
    if len(name) > LONGEST:
        return name, None
    parts = [part for part in re.split(r"[_\s.\-]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name)) if part]
    for count in (3, 2, 1):
        if len(parts) <= count or [part.lower() for part in parts[-2:]] == ["of", "day"]:
            continue
        words = parts[-count:]
        for text in dict.fromkeys(("/".join(words), " ".join(words), "".join(words))):
            unit = unit_of(text, kinds)
            doubtful = text.lower() in DOUBTFUL
            if unit is None and (count > 1 or len(text) < 2 or doubtful or text.lower() in WORDS):
                continue
            if unit is not None or (meanings(text) and not doubtful):
                return "_".join(parts[:-count]), Stated(text, False)
    last = parts[-1].lower() if parts else ""
    for text in IN_WORDS:
        rest = last.removesuffix(text)
        if rest not in ("", last) and all(word in WORDS for word in pieces_of_compound(rest)):
            return name[: -len(text)], Stated(text, False)
    return name, None


def stated_unit(name: str, unit: str, quantity: str) -> tuple[str, Stated | None]:
    """A column's bare name, and the unit that the file (`unit`) or the name states, of a column to be that quantity
    (or of that dimension)."""
    bare, found = bracketed(name)
    kinds = (quantity,) if quantity in DIMENSIONS else dimensions_of(quantity)
    if found is None:
        bare, found = suffixed(bare, kinds)
    return bare, Stated(unit.strip(), True) if is_stated(unit) else found


def fit(quantity: str, name: str, unit: str = "", topic: str = "") -> tuple[float, str | None] | None:
    """How badly a column's name fits a quantity (0: well), and the unit that it states by the table's name (`?`: one
    that is not known, None: none); None where name or unit say that it is something else.

    Args:
        name: of the column, without its topic; unit: as far as the file states it; topic: the topic's name.
    """
    if len(name) > LONGEST:
        return None
    bare, stated = stated_unit(name, unit, quantity)
    kinds = ("time",) if quantity == "time" else dimensions_of(quantity)
    known = unit_of(stated.text, kinds) if stated else None
    if stated and known is None and meanings(stated.text):
        return None
    if known is not None and quantity == "r" and stated and stated.text.lower() in UNCLEAR_RATES:
        known = None
    if not topic and bare.startswith("/"):
        topic, bare = parts_of_path(bare)
    nested = re.match(r"[/.]*([^\s.]+)\.([^\s_].+)", bare)  # `Lng._Vel.` has a dot of an abbreviation
    if not topic and nested:
        topic, bare = nested[1], nested[2]
    said, unknown, numbers = concepts(bare)
    if "heading" in said and RECEIVERS & set(pieces(bare)):
        said = said - {"heading"} | {"course"}  # that they see: where the car moves, not where it points
    if "slip" in said and {"cog", "cg"} & set(pieces(bare)):
        said = said - {"course", "source"} | {"side"}  # at the centre of gravity
    if "longitude" in said and said & {"speed", "acc"}:
        said = said - {"longitude"} | {"long"}
    if quantity == "r" and bare.lower() == "omega" and known is not None:
        said = {"yaw"}
    said |= set(SAYS.get(known.dimension, "").split()) if known is not None else set()
    around, strange, _ = concepts(re.sub(OF_TOPICS, "", topic, flags=re.IGNORECASE))
    rank = _rank(quantity, said, unknown)
    if rank is None and topic:
        rank = _rank(quantity, said | (around - {"target", "other", "engine"}), unknown + min(strange, 1))
    if rank is None:
        return None
    rank += NUMBERED * numbers + _topic_rank(quantity, said, around)
    return rank, _name(known, stated)


def as_yaw(quantity: str, name: str, unit: str = "") -> str | None:
    """The unit that a column states (`?`: none that is known) which would be that quantity if its symbol, phi or theta,
    meant the yaw angle; None of any other column."""
    plain = UNCLEAR.sub("yaw", name)
    fits = None if plain == name else fit(quantity, plain, unit)
    return None if fits is None or fits[0] >= LIMIT else fits[1] or "?"


def _name(known: Unit | None, stated: Stated | None) -> str | None:
    if known is not None:
        return known.name
    if stated is not None:
        return "?"
    return None


def _rank(quantity: str, said: set[str], unknown: int) -> float | None:
    rule = RULES[quantity]
    free = COMMON | set(rule.qualifiers.split())
    for number, way in enumerate(rule.ways):
        needed = set(way.split())
        if needed <= said and said - needed <= free and not (unknown and way in SYMBOLS):
            hand = quantity == "delta_cmd" and _of_handwheel(said)
            return 0.3 * number + UNKNOWN * unknown + (HANDWHEEL if hand else 0.0)
    if quantity == "v" and {"wheel", "speed"} <= said and said - {"wheel", "speed"} <= COMMON:
        return DRIVEN + UNKNOWN * unknown
    return None


def _topic_rank(quantity: str, said: set[str], around: set[str]) -> float:
    """What a topic of commands, or of something else, counts against a column that does not say of what it is."""
    if quantity in ("delta_cmd", "tau_cmd", "time") or said & {"yaw", "car", "slip", "heading", "wheel", "gyro"}:
        return 0.0
    return LIMIT * bool(around & {"other", "engine"}) + 1.0 * bool(around & {"target"})


def is_handwheel(name: str) -> bool:
    """Whether a column is the steering wheel's angle, not the road wheels'."""
    return _of_handwheel(concepts(stated_unit(name, "", "delta_cmd")[0])[0])


def _of_handwheel(said: set[str]) -> bool:
    return ("handwheel" in said or {"steer", "wheel"} <= said) and not said & {"road", "tyre"}


def is_demand(name: str) -> bool:
    """Whether a name says what is asked of the car, as the drive messages of small cars do, not what it does."""
    return "target" in concepts(name)[0] or "drive" in pieces(name)


def is_in_g(name: str) -> bool:
    """Whether a name says g (`GForceX`, `gLat`, `G Lat`)."""
    words = pieces(bracketed(name)[0])
    return any(word in ("g", "gforce", "gforces", "glat", "glong", "glon") for word in words)
