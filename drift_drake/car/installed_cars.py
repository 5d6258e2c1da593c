"""Kinds of car that other packages install: found, and seen to be usable.

A package names a `CarKind` in its pyproject.toml; the name is the key of a vehicle file that holds such a car:

    [project.entry-points."drift_drake.cars"]
    kart = "my_package.kart:KART"
"""

import dataclasses
import itertools
import math
from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np

from drift_drake.car.effects.magnitudes import COUNT, Effects
from drift_drake.car.effects.record import InvalidExtensionError
from drift_drake.car.effects.trial import CARS, extensions, loaded, see_that_they_end
from drift_drake.car.kind import CarKind
from drift_drake.car.lanes import LANES, load_lanes
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.scalar import jitable, stored
from drift_drake.common.errors import one_line

TAKEN = {"single_track", "double_track", "brush", "simulator", "car", "effects",
         *(field.name for field in dataclasses.fields(VehicleParameters))}  # fmt: skip
"""Keys of vehicle files."""
NEEDED = ("mass", "gravity", "friction", "front_axle_distance", "rear_axle_distance")  # of its constants
SPEEDS, SLIDES = (0.0, 1e-6, 3.0, 20.0, -3.0), (0.0, 0.4, -1.5)  # [m/s], [rad]
COMMANDS = ((0.0, 0.0), (0.3, 100.0), (-0.3, -100.0))


@cache
def installed_cars() -> tuple[CarKind, ...]:
    """Kinds of other packages, in the order of their names.

    Raises:
        InvalidExtensionError: one cannot be imported, or is none, or two have one name.
    """
    points = extensions(CARS)
    see_that_they_end(points, try_cars)
    return tuple(_checked(where, point) for where, point in points.items())


def try_cars(begin: Callable[[str], None]) -> None:
    """Loads and checks all, and compiles their functions, for a process of its own (`trial`).

    Args:
        begin: called with what messages call a kind, as its turn comes.

    Raises:
        InvalidExtensionError: one cannot be used, or numba cannot compile it.
    """
    for where, point in extensions(CARS).items():
        begin(where)
        _see_that_it_compiles(where, _checked(where, point))


def _checked(where: str, point: EntryPoint) -> CarKind:
    """The kind under the entry point's name, with the file's dataclass and its functions seen to fit one another."""
    kind = loaded(where, point)
    if not isinstance(kind, CarKind):
        raise InvalidExtensionError(f"{where}: is no drift_drake.car.kind.CarKind; name one in the entry point")
    if point.name in TAKEN:
        raise InvalidExtensionError(f"{where}: {point.name} is a key of vehicle files already; choose another name")
    functions = {name: jitable(getattr(kind, name)) for name in ("rates", "settle", "fastest", "changed_constants")}
    kind = dataclasses.replace(kind, key=point.name, **functions)
    fields: tuple[str, ...] = getattr(kind.constants, "_fields", ())
    if lacking := [name for name in NEEDED if name not in fields]:
        raise InvalidExtensionError(f"{where}: its constants have no {', '.join(lacking)}; add them")
    if len(kind.own_scale) != len(kind.own) or any(not scale > 0.0 for scale in kind.own_scale):
        raise InvalidExtensionError(f"{where}: own_scale does not give a positive size to each of {kind.own}")
    if kind.parameters is None:
        raise InvalidExtensionError(f"{where}: has no parameters; give it the dataclass of a vehicle file")
    try:
        _see_that_it_fits(where, kind, kind.parameters())
    except InvalidExtensionError:
        raise
    except Exception as error:
        raise InvalidExtensionError(f"{where}: fails ({type(error).__name__}: {one_line(error)}); correct it") from None
    return kind


def _see_that_it_fits(where: str, kind: CarKind, car: Any) -> None:
    """Tries a car of the dataclass's defaults: its numbers there and back, and its functions in many states."""
    constants = car.constants()
    if type(constants) is not kind.constants or car.with_constants(constants).constants() != constants:
        raise InvalidExtensionError(f"{where}: its parameters' constants are not {kind.constants.__name__} and back")
    if list(car.to_dict()) != [kind.key] or not isinstance(car.single_track(), VehicleParameters):
        raise InvalidExtensionError(f"{where}: to_dict gives no {kind.key}, or single_track no VehicleParameters")
    if kind.changed_constants(constants, Effects()) != constants:
        raise InvalidExtensionError(f"{where}: its numbers change without effects; let changed_constants not")
    for v, beta, (delta, torque) in itertools.product(SPEEDS, SLIDES, COMMANDS):
        z, out = np.zeros(kind.size), np.full(kind.size, np.nan)
        z[:4] = 0.3, v, beta, 1.1 * v
        kind.settle(z, delta, torque, constants, Effects())
        kind.rates(z, (delta, torque), (constants, Effects(), (0.0, 0.0, 0.0)), out)
        fastest = kind.fastest(z, constants, Effects())
        if not (np.isfinite(out).all() and np.isfinite(z).all() and 0.0 < fastest < math.inf):
            raise InvalidExtensionError(
                f"{where}: at v = {v:g} m/s, beta = {beta:g} rad under {delta:g} rad and {torque:g} N m its rates are "
                f"{out.tolist()} and the fastest {fastest:g}; let all be finite, and the fastest positive"
            )


def _see_that_it_compiles(where: str, kind: CarKind) -> None:
    """Compiles the functions as a diagnosis does, for several cars at once."""
    import numba

    if numba.config.DISABLE_JIT or kind.parameters is None:
        return
    cars_in_lanes, settle, rates, fastest, size = kind.cars_in_lanes, kind.settle, kind.rates, kind.fastest, kind.size

    def tried(numbers: Any, effects: Any, z: Any, out: Any) -> None:
        car, q = cars_in_lanes(numbers, effects)
        delta, torque = load_lanes(z, size), load_lanes(z, size + 1)
        settle(z, delta, torque, car, q)
        rates(z, (delta, torque), (car, q, (0.0, 0.0, 0.0)), out)
        stored(out, 0, fastest((load_lanes(z, 0), load_lanes(z, 1), load_lanes(z, 2), load_lanes(z, 3)), car, q))

    numbers = np.repeat(np.array(kind.flattened(kind.parameters().constants()), dtype=float), LANES)
    try:
        numba.njit(tried)(numbers, np.zeros(COUNT * LANES), np.ones((size + 2) * LANES), np.zeros(size * LANES))
    except Exception as error:  # of many classes
        lines = [line.strip() for line in str(error).splitlines() if line.strip() and "pipeline" not in line]
        raise InvalidExtensionError(
            f"{where}: numba cannot compile its functions ({' '.join(lines[:2])}); use plain arithmetic and the "
            "functions of drift_drake.car.scalar (select in place of if)"
        ) from None
