"""On the API page each field has what its comment says."""

import pytest

pytest.importorskip("griffe", reason="the site is an extra: pip install 'drift_drake[docs]'")

import griffe  # after the skip

from experiments.house.api_fields import FieldComments, said


def test_a_field_says_what_its_comment_says() -> None:
    assert (
        said("    sideslip: float = 1.3  # [rad] beyond which the car has spun")
        == "[rad] beyond which the car has spun"
    )
    assert said('    mass: float = entry("kg", "m", 1650.0)') == "m [kg]"
    assert said("    e_min: Array  # [N+1] [m]") == "[N+1], [m]"
    assert said('    lane: Literal["open"] = "open"') == ""


def test_fields_of_the_package_have_docstrings() -> None:
    extensions = griffe.load_extensions(FieldComments)
    module = griffe.load("drift_drake.drive.loop.endings", extensions=extensions, try_relative_path=False)
    field = module["RunLimits.sideslip"]
    assert field.docstring is not None
    assert field.docstring.value == "[rad] beyond which the car has spun"
