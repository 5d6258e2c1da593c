"""Units as files spell them."""

import math
import re
from pathlib import Path

import pytest

from drift_drake.common.units import DIMENSIONS, OTHER, is_stated, meanings, unit_of
from drift_drake.gap.logs.wording.conversion import QUANTITIES, dimensions_of, factor

SPELLINGS = {
    "km/h": "km/h KM/H Km/h kmh KMH kmph kph KPH km/hr km.h-1 km·h⁻¹ [km/h] (km/h) km\\h km/t km/u km/時",
    "mph": "mph MPH Mph mi/h miles/h miles/hour",
    "kn": "kn kt kts KTS knots Knots knot",
    "ft/s": "ft/s FT/S fps ft/sec",
    "m/s": "m/s M/S m/sec m.s-1 m·s⁻¹ m*s^-1 mps ms-1",
    "deg/s": "deg/s Deg/s DEG/S °/s º/s ˚/s dps deg/sec degrees/second Grad/s deg.s-1 Â°/s grader/s 度/秒 도/초",
    "rad/s": "rad/s RAD/S rad/sec radps rad.s-1",
    "rpm": "rpm RPM 1/min U/min tr/min rev/min min-1",
    "m/s^2": "m/s^2 m/s² m/s2 M/S2 m.s-2 m·s⁻² m/s/s m/sec^2 m/s**2 mps2",
    "g": "g G gees",
    "Gal": "Gal gal",
    "N m": "Nm NM N.m N·m N*m N-m newton-meters",
    "lb ft": "lb-ft ft-lb lbft ft.lbs lbf·ft ft-lbf",
    "deg": "deg DEG Deg ° degrees Grad grader graden gradi degrés 度 도",
    "s": "s sec SEC seconds Sekunden 秒 초",
    "ms": "ms msec milliseconds",
    "us": "us µs μs usec",
    "%": "% pct percent",
}


@pytest.mark.parametrize("unit", sorted(SPELLINGS))
def test_spellings(unit):
    for text in SPELLINGS[unit].split():
        found = unit_of(text.replace("_", " "))
        assert found is not None, text
        assert found.name == unit, text


def test_every_unit_of_the_table_is_itself():
    for kind, (base, units) in DIMENSIONS.items():
        assert units[base] == 1.0
        for name, size in units.items():
            assert meanings(name)[0] == (name, kind, size)


def test_products_that_the_table_does_not_name():
    assert factor("mm/min", ("speed",)) == pytest.approx(1e-3 / 60.0)
    assert factor("deg/min", ("angular rate",)) == pytest.approx(math.radians(1.0) / 60.0)
    assert factor("km/h/s", ("acceleration",)) == pytest.approx(1.0 / 3.6)


def test_case_tells_units_apart_where_it_has_to():
    assert unit_of("kN").dimension == "force"
    assert unit_of("kn").dimension == "speed"
    assert unit_of("KN", ("speed",)).name == "kn"


@pytest.mark.parametrize("text", ["rad/s^2", "°C", "V", "Hz", "kPa", "psi", "kg m2", "N/mm", "deg/s/s", "l/h"])
def test_units_of_other_dimensions_are_known_for_what_they_are(text):
    assert [unit.dimension for unit in meanings(text)] == [OTHER]


@pytest.mark.parametrize("text", ["wug", "furlong/s", "", "km/", "/", "m/s^99", "%FS", "x" * 1000, "\x00", "hh:mm:ss"])
def test_what_is_no_unit(text):
    assert meanings(text) == ()


def test_what_states_nothing():
    assert not any(map(is_stated, ["", " ", "[]", "n/a", "none", "?"]))
    assert is_stated("wug")


def test_of_a_spelling_of_two_units_the_quantity_decides():
    for name, kind in QUANTITIES.items():
        if kind in ("angle", "angular rate"):
            assert unit_of("degs", dimensions_of(name)).dimension == kind
    assert unit_of("ms", dimensions_of("v")).name == "m/s"
    with pytest.raises(ValueError, match="unknown unit 'kg'; known are the units of speed"):
        factor("kg", ("speed",))


def test_the_page_on_formats_lists_the_units():
    """Each, or the two that it is a quotient of."""
    page = (Path(__file__).parents[3] / "docs" / "formats.md").read_text(encoding="utf-8")
    section = page.split("### Units\n")[1].split("\n### ")[0]
    said = set(re.split(r"[,.]\s+|:\s+|\n|Also ", section))
    for _, units in DIMENSIONS.values():
        for unit in units:
            parts = unit.removesuffix("^2").split("/")
            assert unit in said or (len(parts) == 2 and set(parts) <= said), unit
