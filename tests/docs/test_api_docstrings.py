"""Docstrings of all public names: what each argument and field is, units or shapes, errors, and sources."""

import ast
import itertools
import re
from collections.abc import Iterator
from functools import cache

import pytest
from api_names import ROOT, Door, covered, docstring, documented, doors, errors, public, raised

CLASSES = {name: one for name, one in public().items() if isinstance(one[1], ast.ClassDef)}
NUMBERS = re.compile(r"\b(float|Array|ArrayLike|ndarray)\b")
NEAR = 110  # letters between a name and its unit or shape, in the same sentence
# Said by the kind of thing that they are: a file of the function's name, and a Context of the system itself.
PLAIN = ("path", "context")
# What a plant's template asks of its equations: no call of a user's (`car.path_plant`).
HOOKS = ("VehiclePlant.declare", "VehiclePlant.settled", "VehiclePlant.rates", "VehiclePlant.compiled_rates")
DOORS = [door for door in doors() if door.name not in HOOKS]
# A sentence above the fields says the unit of all of them.
OF_ALL = {"Tolerance": "relative [-], unless a unit is given"}
SOURCES = {  # what computes an equation, and whose
    "Posterior": "Davydov", "BayesianAdapter": "section II", "BayesianModel": "section II", "learn": "section II",
    "learn_drive": "section II", "step_model": "section II", "LinearInterpolationActuator": "section II",
    "OptimalControlProblem": "section III", "ocp": "section III", "info_ocp": "section III",
    "plan_drive": "section III", "Mpc": "section III", "MpcController": "section III",
    "GatheringConfig": "section IV-A", "straight_line": "section IV-A", "loops": "section IV-C",
    "figure_8": "Goh and Gerdes 2016", "plan_from_answer": "Atkinson and Fedorov 1975",
    "VehiclePlant": "the paper's appendix",
}  # fmt: skip


def name_of(door: Door) -> str:
    return door.name


def with_unit(text: str, name: str) -> bool:
    """Whether a text says a unit or a shape in brackets after a name, or after names that it is one of."""
    flat = " ".join(text.split())
    return any(
        "[" in flat[found.end() : found.end() + NEAR].split(". ")[0]
        for found in re.finditer(rf"(?<![\w.]){re.escape(name)}\b", flat)
    )


def parameters(door: Door) -> Iterator[tuple[str, str]]:
    """(name, type) of what is given to a door."""
    for node in door.nodes:
        given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        yield from [(one.arg, ast.unparse(one.annotation)) for one in given if one.annotation]


@pytest.mark.parametrize("door", DOORS, ids=name_of)
def test_each_argument_is_named_and_each_number_has_a_unit_or_a_shape(door: Door) -> None:
    for name, kind in parameters(door):
        assert name in PLAIN or re.search(rf"\b{name}\b", door.text), f"{name}: say what it is"
        assert not NUMBERS.search(kind) or with_unit(door.text, name), f"{name}: say its unit or shape, such as [m]"


@pytest.mark.parametrize("door", DOORS, ids=name_of)
def test_a_number_that_is_returned_has_a_unit_or_a_shape(door: Door) -> None:
    for node in door.nodes:
        if node.returns is not None and NUMBERS.search(ast.unparse(node.returns)):
            assert "[" in door.text, f"returns {ast.unparse(node.returns)}: say its unit or shape"


@pytest.mark.parametrize("door", DOORS, ids=name_of)
def test_errors_are_named(door: Door) -> None:
    """All of the package's, and all that the body itself raises; a class above one names it, too."""
    own = {
        part.exc.func.id
        for node in door.nodes
        for part in ast.walk(node)
        if isinstance(part, ast.Raise) and isinstance(part.exc, ast.Call) and isinstance(part.exc.func, ast.Name)
    }
    asked = {error for error in raised(door) if "DriftDrakeError" in errors()[error] or error in own}
    # One of another process, of a class that is named; and what an installed package's effect or tyre is refused by.
    asked -= {"DriftDrakeError", "InvalidExtensionError"}
    said = documented(door.text)
    missing = {error for error in asked if not covered(error, said)}
    assert not missing, f"Raises: {', '.join(sorted(missing))}"


@pytest.mark.parametrize("door", DOORS, ids=name_of)
def test_a_shape_and_a_unit_are_no_link(door: Door) -> None:
    assert "] [" not in door.text, "Markdown takes [N] [m] for a link; write [N] in m"


@cache
def lines(module: str) -> list[str]:
    path = ROOT.joinpath(*module.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return file.read_text(encoding="utf-8").splitlines()


def fields(name: str) -> Iterator[tuple[str, str, str]]:
    """(name, type, what is said of it) of each field: by a comment, a docstring below it, or a vehicle's `entry`."""
    module, node = CLASSES[name]
    for field, after in itertools.pairwise([*node.body, ast.Pass()]):
        if not isinstance(field, ast.AnnAssign) or "ClassVar" in ast.unparse(field.annotation):
            continue
        said = ["\n".join(lines(module)[field.lineno - 1 : field.end_lineno]).partition("#")[2]]
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            said.append(str(after.value.value))
        if isinstance(field.value, ast.Call) and ast.unparse(field.value.func) == "entry":
            said.append(f"[{ast.literal_eval(field.value.args[0])}]")
        yield ast.unparse(field.target), ast.unparse(field.annotation), " ".join(said).strip()


@pytest.mark.parametrize("name", CLASSES)
def test_each_field_is_said_and_each_number_has_a_unit_or_a_shape(name: str) -> None:
    whole = docstring(CLASSES[name][1])
    assert OF_ALL.get(name, "") in whole
    for field, kind, said in fields(name):
        assert name in OF_ALL or said or re.search(rf"\b{field}\b", whole), f"{field}: say what it is"
        number = NUMBERS.search(kind) and name not in OF_ALL
        assert not number or "[" in said or with_unit(whole, field), f"{field}: say its unit or shape, such as [m]"


@pytest.mark.parametrize("name", SOURCES)
def test_an_equation_has_a_source(name: str) -> None:
    assert SOURCES[name] in " ".join(docstring(public()[name][1]).split())


def test_what_is_missing_is_found() -> None:
    node = ast.parse('def f(speed: float, x: Array) -> None:\n    raise ValueError("x")\n').body[0]
    assert isinstance(node, ast.FunctionDef)
    assert raised(Door("f", "drift_drake.car.tyre", (node,), "", None)) == {"ValueError"}
    assert with_unit("`speed`: of the car [m/s].", "speed")
    assert with_unit("states x [n], u [2]", "x")
    assert not with_unit("speed: of the car. x [n]", "speed")
    assert documented("A.\n\nRaises:\n    OneError: a; TwoError: b.\n\nExamples:\n    ThreeError") == {
        "OneError",
        "TwoError",
    }
    assert documented("Writes a file; OutputError where it cannot.") == {"OutputError"}
    assert len(public()) > 60
