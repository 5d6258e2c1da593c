"""Units as files spell them: `MPH`, `km/hr`, `m·s⁻²`, `Deg/sec`, `Nm`. Case counts only where it tells units apart.

pint knows more units, but to it radians are numbers (rad/s and Hz are alike), g is a gram and kt a kiloton.
"""

import functools
import itertools
import math
import re
import unicodedata
from typing import NamedTuple

DIMENSIONS = {  # of a quantity: its SI unit, and the factors to it
    "time": ("s", {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "day": 86400.0}),
    "length": (
        "m",
        {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "dm": 0.1, "km": 1e3, "ft": 0.3048, "in": 0.0254, "yd": 0.9144,
         "mi": 1609.344},
    ),
    "angle": ("rad", {"rad": 1.0, "deg": math.pi / 180.0, "rev": 2.0 * math.pi, "mrad": 1e-3}),
    "speed": (
        "m/s",
        {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "mph": 0.44704, "kn": 1852.0 / 3600.0,
         "ft/s": 0.3048},
    ),
    "angular rate": (
        "rad/s",
        {"rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0, "rev/s": 2.0 * math.pi, "mrad/s": 1e-3,
         "mdeg/s": 1e-3 * math.pi / 180.0},
    ),
    "acceleration": (
        "m/s^2",
        {"m/s^2": 1.0, "cm/s^2": 1e-2, "mm/s^2": 1e-3, "g": 9.80665, "mg": 9.80665e-3, "ft/s^2": 0.3048,
         "Gal": 1e-2},
    ),
    "torque": ("N m", {"N m": 1.0, "kN m": 1e3, "lb ft": 1.3558179, "lb in": 0.1129848, "kgf m": 9.80665}),
    "force": ("N", {"N": 1.0, "kN": 1e3, "lbf": 4.4482216, "kgf": 9.80665}),
    "number": ("-", {"-": 1.0, "%": 0.01}),
}  # fmt: skip
PACKED = {"hhmmss": 1.0, "hhmmssfff": 1000.0}  # of a clock whose digits are packed: what its last second counts
OTHER = "other"  # dimension of a unit that is known, and that no quantity of a log has

WORDS = {  # of a unit of the table, or of a factor in products: further spellings, in lower case
    "s": (
        "unixtime utc epoch sec secs second seconds sek sekunde sekunden seconde secondes segundos secondi "
        "sekunder 秒 초 \u0441 сек"
    ),
    "ms": "мс 毫秒 ミリ秒 msec msecs millisec millisecond milliseconds millisekunden",
    "us": "usec microsec microsecond microseconds mus",
    "ns": "nsec nanosec nanosecond nanoseconds",
    "min": "mins minute minutes minuten",
    "h": "ч год hr hrs hour hours std stunde stunden heure heures",
    "day": "days d tag tage jour jours",
    "m": "м meter meters metre metres",
    "mm": "millimeter millimeters millimetre millimetres",
    "cm": "centimeter centimeters centimetre centimetres",
    "km": "км kilometer kilometers kilometre kilometres kms",
    "ft": "foot feet",
    "in": "inch inches",
    "yd": "yard yards",
    "mi": "mile miles",
    "rad": "рад radian radians rads radiant",
    "deg": (
        "degree degrees degs grad grader graden grados gradi graus degré degrés stupnu stopni derece fok град ° º 度 도"
    ),
    "mrad": "mrads millirad milliradian milliradians",
    "rev": "revs revolution revolutions turn turns umdrehung umdrehungen tour tours tr u",
    "m/s": "mps ms-1 meterpersecond meterspersecond m/sec",
    "km/h": (
        "kmh kph kmph kmhr km/hr kmh-1 km/t km/u km/時 km/sa км/ч км/год "
        "kilometersperhour kilometresperhour kilometerperhour"
    ),
    "mph": "mi/h mi/hr miles/h miles/hr milesperhour mileperhour",
    "kn": "kt kts knot knots knoten noeud noeuds nmi/h",
    "ft/s": "fps feetpersecond",
    "rad/s": "rads radps radpersec radiansps rads-1",
    "deg/s": "dps degps degs degpersec °ps degreesps degs-1",
    "rpm": "1/min min-1 upm u/min tr/min r/min rev/min revpm revsperminute",
    "rev/s": "rps hz/rev",
    "mdeg/s": "mdps",
    "m/s^2": "mps2 ms-2 m/s/s mpss m/ss ms2 mss",
    "g": "gs g's gee gees gn g0 g-force",
    "mg": "milli-g millig",
    "ft/s^2": "fps2 ft/s/s",
    "Gal": "gal galileo",
    "N m": "nm newtonmeter newtonmeters newtonmetre newtonmetres nmeter",
    "kN m": "knm",
    "lb ft": "lbft ftlb ftlbs lbfft ftlbf lbsft poundfoot poundfeet footpounds footpound",
    "lb in": "lbin inlb inlbs lbfin inlbf",
    "kgf m": "kgm kgfm mkp mkg",
    "N": "newton newtons",
    "kN": "kilonewton",
    "-": "1 ratio unitless dimensionless norm normalized normalised none_",
    "%": "percent pct prozent perc",
}
OTHERS = (  # of other dimensions, in lower case
    "hz khz mhz 1/s s-1 v mv volt volts kv a ma amp amps ampere w kw mw watt hp bhp ps cv pa kpa hpa mpa bar mbar psi "
    "c f k °c °f degc degf celsius fahrenheit kelvin l ml liter litre gal kg lb lbs pound pounds ppm lambda afr db dbm "
    "bit bits byte bytes raw count counts cnt # bool boolean enum state sats lap laps gear index id "
    "kpa/s l/h kg/h g/s mg/s n/m n/mm j kj nmi t ut gauss ohm ° c ° f deg c deg f l/min"
)  # fmt: skip
UNSTATED = ("", "?", "n/a", "na", "nan", "none", "null", "unknown", "unit", "units", "no unit", "--", "[]", "()",
            "wgs84", "wgs 84")  # fmt: skip
FACTORS = {"m": (1, 0, 0, 0), "s": (0, 1, 0, 0), "rad": (0, 0, 1, 0), "N": (0, 0, 0, 1)}  # SI, as exponents
POWERS = {"length": FACTORS["m"], "time": FACTORS["s"], "angle": FACTORS["rad"], "force": FACTORS["N"],
          "speed": (1, -1, 0, 0), "angular rate": (0, -1, 1, 0), "acceleration": (1, -2, 0, 0),
          "torque": (1, 0, 0, 1), "number": (0, 0, 0, 0)}  # fmt: skip
SIGNS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺−–·×⋅*∙µμº˚�", "0123456789-+--.....uu°°°")  # noqa: RUF001
LONGEST = 40  # characters of a unit


class Unit(NamedTuple):
    """A unit that is known: its name in the table (or as it is spelt), its dimension and its factor to SI."""

    name: str
    dimension: str
    factor: float


def _table() -> tuple[dict[str, list[Unit]], dict[str, list[Unit]]]:
    """Units by their name, and by each spelling in lower case; some are of several (`rads`, `speed_ms`)."""
    named = {unit: Unit(unit, kind, size) for kind, (_, units) in DIMENSIONS.items() for unit, size in units.items()}
    spelt: dict[str, list[Unit]] = {}
    for name, unit in named.items():
        for word in {name.lower(), name.lower().replace(" ", ""), *WORDS.get(name, "").split()}:
            spelt.setdefault(word, []).append(unit)
    for word in OTHERS.split():
        spelt.setdefault(word, [Unit(word, OTHER, math.nan)])
    return {name: [unit, named["m/s"]] if name == "ms" else [unit] for name, unit in named.items()}, spelt


NAMED, SPELT = _table()


def is_stated(text: str) -> bool:
    """Whether a text that stands where a unit belongs says anything of one."""
    return text.strip().strip("[]()").strip().lower() not in UNSTATED


@functools.lru_cache(maxsize=4096)
def meanings(text: str) -> tuple[Unit, ...]:
    """The units that a text may mean, none where it is not known; of several the most usual first."""
    if len(text) > LONGEST or not (plain := _plain(text)):
        return ()
    for words, name in ((NAMED, text.strip()), (NAMED, plain), (SPELT, plain.lower())):
        if name in words:
            return tuple(words[name])
    close = re.sub(r"[\s.^_]+", "", plain.lower())
    for name in (close, close.replace("-", "") if not re.search(r"-\d", close) else close):
        if name in SPELT:
            return tuple(SPELT[name])
    product = _product(re.sub(r"\bper\b|(?<=[a-z°])\s+p\s+(?=[a-z])", "/", plain))
    return () if product is None else (product,)


def unit_of(text: str, kinds: tuple[str, ...] | None = None) -> Unit | None:
    """The unit that a text means, of one of these dimensions (None: of any); None where it means none of them."""
    return next((unit for unit in meanings(text) if kinds is None or unit.dimension in kinds), None)


def hertz(text: object) -> float:
    """A rate [Hz] written as `100 Hz` or `2.5 kHz`; NaN of anything else."""
    found = re.fullmatch(r"\s*(\d+\.?\d*(?:[eE][+-]?\d+)?)\s*(k?)Hz\s*", text) if isinstance(text, str) else None
    return float(found[1]) * (1e3 if found[2] else 1.0) if found else math.nan


def _plain(text: str) -> str:
    """Without brackets, quotes, typographic signs."""
    plain = text.replace("**", "^").replace("Â", "").replace("œ", "oe").translate(SIGNS)
    plain = unicodedata.normalize("NFKC", plain).translate(SIGNS).strip().strip("\"'").strip()
    while len(plain) > 1 and plain[0] + plain[-1] in ("[]", "()", "{}", "<>"):
        plain = plain[1:-1].strip()
    plain = plain.replace("\\", "/").replace("deg.", "deg").replace("sec.", "sec")
    return re.sub(r"\s*/\s*", "/", plain)


def _product(plain: str) -> Unit | None:
    """A product of known factors, such as `cm/s` or `kN.m.s-1`."""
    powers, size, other = [0, 0, 0, 0], 1.0, False
    for number, part in enumerate(plain.split("/")):
        for factor in re.split(r"[\s.]+|(?<=[A-Za-z°])-(?=[A-Za-z])", part.strip("() ")):
            if factor == "1" and number == 0:
                continue
            found = re.fullmatch(r"([^\d^+-]+)\^?([+-]?\d)?", factor)
            unit = _factor(found[1]) if found else None
            if found is None or unit is None:
                return None
            other |= unit.dimension == OTHER
            exponent = int(found[2] or 1) * (1 if number == 0 else -1)
            powers = [a + exponent * b for a, b in zip(powers, POWERS.get(unit.dimension, powers), strict=True)]
            size *= unit.factor**exponent
    kind = OTHER if other else next((kind for kind, own in POWERS.items() if list(own) == powers), OTHER)
    if kind == OTHER:
        return Unit(plain, OTHER, math.nan)
    same = (name for name, known in DIMENSIONS[kind][1].items() if math.isclose(known, size, rel_tol=1e-6))
    return Unit(next(same, plain), kind, size)


def _factor(word: str) -> Unit | None:
    return next(itertools.chain(NAMED.get(word, ()), SPELT.get(word.lower(), ())), None)
