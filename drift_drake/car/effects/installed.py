"""Effects that other packages install: found, seen to be usable, and hashed."""

import dataclasses
import itertools
import keyword
import math
import random
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any, get_args

from drift_drake.car.effects.record import (
    COMMANDS,
    FUNCTIONS,
    PHYSICS,
    READ,
    REFERENCE,
    Distribution,
    Effect,
    Fit,
    InvalidExtensionError,
)
from drift_drake.car.effects.trial import EFFECTS, extensions, loaded, see_that_they_end
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import one_line, shown
from drift_drake.common.interruption import TerminatedError
from drift_drake.common.plain_files import number

LOG_COLUMNS = ("x", "y", "psi", "r", "v", "beta", "omega_r", "ax", "ay", "delta_cmd", "tau_cmd", "bank")
TAKEN = {"none", "unknown", "tyre", "effects", *(field.name for field in dataclasses.fields(VehicleParameters))}
"""Names of verdicts and of what a vehicle file holds."""
NUMBERS = ("low", "high", "mass", "length", "radius", "daily")
TEXTS = ("unit", "change", "shown_by")
FLAGS = ("spread", "of_tyres_or_body", "varies", "factor", "share", "limit", "saturates", "asked", "at_the_limit",
         "resists", "rolls", "of_road")  # fmt: skip
KINDS: tuple[tuple[tuple[str, ...], Callable[[Any], bool], str], ...] = (
    (TEXTS, lambda value: isinstance(value, str), "a text"),
    (FLAGS, lambda value: isinstance(value, bool), "True or False"),
    (FUNCTIONS, lambda value: value is None or callable(value), "a function"),
    (("drawn", "drawn_out_of_distribution"), lambda value: isinstance(value, Distribution | None), "a Distribution"),
    (("scales",), lambda value: value in (None, *READ), f"one of {', '.join(READ)}"),
    (("double_track",), lambda value: value in ("effect", "nothing"), "'effect' or 'nothing'"),
)
CHOICES = {"needs": LOG_COLUMNS, "remembers": COMMANDS, "fitted": get_args(Fit)}
RESULTS = {"force": 3, "actuation": 2, "reading": 3, "rate": 1, "start": 1}  # how many numbers a function gives
STATES = 100  # of a drive, in which physics are tried
EXTREMES = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 1e-6, 0.0, 1e-6, 0.0, 0.0, 1e3),
    (0.1, -5.0, 0.01, -5.0, 0.1, 100.0, 0.3),
    (-20.0, 100.0, 3.1, 200.0, -1.0, -1e5, -1e3), (20.0, 100.0, -3.1, 0.0, 1.0, 1e5, 50.0),
)  # fmt: skip
"""Standing, creeping, backwards, spinning and locked: compiled functions must end there, too."""


@cache
def installed_effects() -> dict[str, Effect]:
    """Effects of other packages by name, in the order of their names.

    A package names an effect, an `Effect` with its physics or that `delays` a command, in its pyproject.toml:

        [project.entry-points."drift_drake.effects"]
        side_wind = "my_package.wind:SIDE_WIND"

    Raises:
        InvalidExtensionError: one cannot be imported, or is none, or two have one name.
    """
    points = extensions(EFFECTS)
    see_that_they_end(points, try_effects)
    return {point.name: _loaded(where, point) for where, point in points.items()}


def _loaded(where: str, point: EntryPoint) -> Effect:
    effect = loaded(where, point)
    if not point.name.isidentifier() or point.name.startswith("_") or keyword.iskeyword(point.name):
        raise InvalidExtensionError(f"{where}: its name is no name of a variable; choose one such as side_wind")
    if point.name in TAKEN:
        raise InvalidExtensionError(f"{where}: {point.name} is a verdict or in vehicle files; choose another name")
    if not isinstance(effect, Effect):
        raise InvalidExtensionError(f"{where}: is no drift_drake.Effect; name one in the entry point")
    _check_record(where, effect)
    (_check_delay if effect.delays or effect.hastens or effect.late else _check_physics)(where, effect)
    return effect


def _check_record(where: str, effect: Effect) -> None:
    """Sees that what the record says is of the right kind, and its range one."""
    for names, fits, wanted in KINDS:
        for name in names:
            if not fits(getattr(effect, name)):
                raise InvalidExtensionError(f"{where}: {name} is {shown(getattr(effect, name))}; give {wanted}")
    for name in NUMBERS:
        try:
            number(getattr(effect, name))
        except ValueError:
            shown_value = shown(getattr(effect, name))
            raise InvalidExtensionError(f"{where}: {name} is {shown_value}; give a finite number") from None
    low, high = effect.low, effect.high
    if not low < high or high <= 0.0 or (effect.spread and low <= 0.0) or effect.daily <= 0.0:
        raise InvalidExtensionError(
            f"{where}: its range is {low:g} to {high:g} and daily {effect.daily:g}; let low be below high, high and "
            "daily above zero, and with 'spread' low too"
        )
    for name, known in CHOICES.items():
        names = getattr(effect, name)
        if not isinstance(names, tuple) or not all(one in known for one in names):
            raise InvalidExtensionError(
                f"{where}: {name} is {shown(names)}; give a tuple of some of {', '.join(known)}"
            )


def _check_delay(where: str, effect: Effect) -> None:
    """Sees that a delay is nothing but one, of a command of the logs."""
    functions = [name for name in FUNCTIONS if getattr(effect, name) is not None]
    if effect.hastens or effect.late:
        raise InvalidExtensionError(f"{where}: hastens commands or delays readings; use the catalogue's own")
    if effect.delays not in COMMANDS or effect.stage != "command" or functions:
        raise InvalidExtensionError(
            f"{where}: delays '{effect.delays}' at stage '{effect.stage}' with {functions or 'no functions'}; let a "
            f"delay be of {' or '.join(COMMANDS)}, at stage 'command', without functions"
        )
    if not 0.0 < effect.low < effect.high:
        raise InvalidExtensionError(f"{where}: its range begins at {effect.low:g} s; give a delay one above zero")
    if effect.delays == "tau_cmd" and "tau_cmd" not in effect.needs:
        raise InvalidExtensionError(f"{where}: delays the torque; let it need its column (needs=('tau_cmd',))")


def _check_physics(where: str, effect: Effect) -> None:
    """Sees that the effect's function is there, and does nothing at a magnitude of zero."""
    given = [name for name in PHYSICS.values() if getattr(effect, name) is not None]
    wanted = PHYSICS.get(effect.stage, "")
    if effect.scales and effect.stage == "sensor" and not given:
        return
    if given != [wanted]:
        stages = ", ".join(f"{name} for stage '{stage}'" for stage, name in (*PHYSICS.items(), ("command", "delays")))
        raise InvalidExtensionError(f"{where}: has stage '{effect.stage}' and {given or 'no physics'}; give {stages}")
    state = _check_state(where, effect)
    trials: dict[str, tuple[tuple[Any, ...], tuple[float, ...]]] = {
        "force": ((0.1, 12.0, 0.02, 12.1, 0.3, REFERENCE.constants()), (0.0, 0.0, 0.0)),
        "actuation": ((0.05, 100.0, 12.0), (0.05, 100.0)),
        "reading": ((0.1, 0.02, 12.1), (0.0, 0.0, 0.0)),
    }
    arguments, nothing = trials[wanted]
    found = _tried(where, effect, wanted, (*arguments, 0.0, *state))
    if found != nothing:
        raise InvalidExtensionError(
            f"{where}: its {wanted} gives {found} at a magnitude of zero; let it give {nothing}"
        )
    for moving, magnitude in itertools.product(_states(), (effect.low, effect.high)):
        own = () if effect.start is None else _tried(where, effect, "start", _calls(*moving, magnitude, ())["start"])
        for name, call in _calls(*moving, magnitude, own).items():
            if getattr(effect, name) is not None:
                _tried(where, effect, name, call)


def _states() -> list[tuple[float, float, float, float, float, float, float]]:
    """(r, v, beta, omega_r, delta, tau, psi) of drives, sliding ones among them."""
    chance = random.Random(0)
    states = []
    for _ in range(STATES):
        r, beta, slip, delta, tau, psi = (chance.uniform(-1.0, 1.0) for _ in range(6))
        v = chance.uniform(0.5, 40.0)
        states.append((r, v, beta, v * (1.0 + 0.5 * slip), 0.6 * delta, 1000.0 * tau, 3.0 * psi))
    return states


def _calls(
    r: float, v: float, beta: float, omega_r: float, delta: float, tau: float, psi: float, magnitude: float,
    state: tuple[float, ...],
) -> dict[str, tuple[Any, ...]]:  # fmt: skip
    """The arguments of an effect's functions in one state of the car."""
    car = REFERENCE.constants()
    return {
        "force": (r, v, beta, omega_r, psi, car, magnitude, *state),
        "actuation": (delta, tau, v, magnitude, *state),
        "reading": (r, beta, omega_r, magnitude),
        "rate": (r, v, beta, omega_r, delta, tau, car, magnitude, *state),
        "start": (r, v, beta, omega_r, delta, tau, car, magnitude),
    }


def _tried(where: str, effect: Effect, name: str, arguments: tuple[Any, ...]) -> tuple[float, ...]:
    """What a function gives: so many finite numbers."""
    try:
        with redirect_stdout(sys.stderr):
            given = getattr(effect, name)(*arguments)
        found = tuple(map(float, given if RESULTS[name] > 1 else (given,)))
    except (KeyboardInterrupt, TerminatedError):
        raise
    except BaseException as error:
        raise InvalidExtensionError(
            f"{where}: its {name} fails ({type(error).__name__}: {one_line(error)}); correct it"
        ) from None
    if len(found) != RESULTS[name] or not all(map(math.isfinite, found)):
        numbers = tuple(one for one in arguments if isinstance(one, float))
        raise InvalidExtensionError(
            f"{where}: its {name} gives {shown(found)} for {shown(numbers)}; let it give {RESULTS[name]} finite numbers"
        )
    return found


def try_effects(begin: Callable[[str], None]) -> None:
    """Loads all, compiles their functions, calls these in many states: for a process of its own (`trial`).

    Args:
        begin: called with what messages call an effect, as its turn comes.

    Raises:
        InvalidExtensionError: one cannot be used, or numba cannot compile it.
    """
    for where, point in extensions(EFFECTS).items():
        begin(where)
        _see_that_it_compiles(point.name, _loaded(where, point))


def _see_that_it_compiles(name: str, effect: Effect) -> None:
    functions = {kind: function for kind in FUNCTIONS if (function := getattr(effect, kind)) is not None}
    if not functions:
        return
    import numba

    from drift_drake.car.lanes import lanes

    if numba.config.DISABLE_JIT:
        return
    own = (0.0,) if effect.rate else ()
    constants = REFERENCE.constants()
    cars = numba.types.NamedTuple((*[lanes] * (len(constants) - 1), numba.float64), type(constants))
    for kind, function in functions.items():
        compiled, arguments = numba.njit(function), _calls(*_states()[0], effect.high, own)[kind]
        with _named(name, kind):
            compiled(*arguments)
        magnitudes = (0.0, effect.low, effect.high, 0.5 * effect.high, 2.0 * effect.high)
        for moving, magnitude in itertools.product((*_states(), *EXTREMES), magnitudes):
            with suppress(ArithmeticError, ValueError):  # that all is finite is seen in `_tried`
                compiled(*_calls(*moving, magnitude, own)[kind])
        with _named(name, kind):  # a diagnosis computes several cars at once: `if` compares none of their numbers
            numba.njit(function, no_cpython_wrapper=True).compile(
                tuple(lanes if isinstance(argument, float) else cars for argument in arguments)
            )


@contextmanager
def _named(name: str, kind: str) -> Iterator[None]:
    """Has an error of numba's name the function."""
    try:
        yield
    except Exception as error:  # of many classes
        lines = [line.strip() for line in str(error).splitlines() if line.strip() and "pipeline" not in line]
        raise InvalidExtensionError(
            f"effect {name}: numba cannot compile its {kind} ({' '.join(lines[:2])}); use plain arithmetic and the "
            "functions of drift_drake.car.scalar (select in place of if)"
        ) from None


def _check_state(where: str, effect: Effect) -> tuple[float, ...]:
    """The state of an effect at a magnitude of zero, if it has one, seen to be finite and so its rate."""
    if effect.rate is None and effect.start is None:
        return ()
    if effect.rate is None or effect.start is None or effect.reading:
        raise InvalidExtensionError(
            f"{where}: a state needs both rate and start, with a force or an actuation; give both or none"
        )
    moving = (0.1, 12.0, 0.02, 12.1, 0.05, 100.0, REFERENCE.constants(), 0.0)
    try:
        state = float(effect.start(*moving))
        rate = float(effect.rate(*moving, state))
    except (KeyboardInterrupt, TerminatedError):
        raise
    except BaseException as error:
        raise InvalidExtensionError(f"{where}: its rate or start fails ({one_line(error)}); correct it") from None
    if not (math.isfinite(state) and math.isfinite(rate)):
        raise InvalidExtensionError(
            f"{where}: its state {state:g} or rate {rate:g} is not finite at a magnitude of zero; bound its divisor"
        )
    return (state,)
