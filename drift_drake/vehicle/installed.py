"""Effects of other packages, found by their entry points: records that the catalogue then holds, and their physics.

A package names an effect in its pyproject.toml:

    [project.entry-points."drift_drake.effects"]
    side_wind = "my_package.wind:SIDE_WIND"

where `SIDE_WIND` is a `vehicle.effect.Effect` with its physics, or that `delays` a command.
"""

import hashlib
import math
import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, get_args

from drift_drake.errors import DriftDrakeError, one_line
from drift_drake.vehicle.effect import REFERENCE, Command, Effect

GROUP = "drift_drake.effects"
PHYSICS = {"motion": "force", "actuator": "actuation", "sensor": "reading"}  # of a stage, the function that it needs
FUNCTIONS = (*PHYSICS.values(), "rate", "start")
COMMANDS = get_args(Command)


class InvalidExtensionError(DriftDrakeError, ValueError):
    """An effect or a tyre of another package that cannot be used; the message names it and the remedy."""


@cache
def installed_effects() -> dict[str, Effect]:
    """Effects of other packages by name, in the order of their names.

    Raises:
        InvalidExtensionError: one cannot be imported, or is none.
    """
    points = sorted(entry_points(group=GROUP), key=lambda point: point.name)
    return {point.name: _loaded(point) for point in points}


def loaded(where: str, point: EntryPoint) -> Any:
    """What an entry point names; `where` begins the message.

    Raises:
        InvalidExtensionError: it cannot be imported.
    """
    try:
        return point.load()
    except Exception as error:
        raise InvalidExtensionError(
            f"{where}: cannot be imported ({one_line(error)}); correct it or uninstall it"
        ) from None


def _loaded(point: EntryPoint) -> Effect:
    where = f"effect {point.name} ({point.value})"
    effect = loaded(where, point)
    if not point.name.isidentifier() or point.name.startswith("_"):
        raise InvalidExtensionError(f"{where}: its name is no name of a variable; choose one such as side_wind")
    if not isinstance(effect, Effect):
        raise InvalidExtensionError(f"{where}: is no drift_drake.Effect; name one in the entry point")
    (_check_delay if effect.delays else _check_physics)(where, effect)
    return effect


def _check_delay(where: str, effect: Effect) -> None:
    """Sees that a delay is nothing but one, of a command of the logs."""
    functions = [name for name in FUNCTIONS if getattr(effect, name) is not None]
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
    try:
        found = tuple(float(value) for value in getattr(effect, wanted)(*arguments, 0.0, *state))
    except Exception as error:
        raise InvalidExtensionError(f"{where}: its {wanted} fails ({one_line(error)}); correct it") from None
    if found != nothing:
        raise InvalidExtensionError(
            f"{where}: its {wanted} gives {found} at a magnitude of zero; let it give {nothing}"
        )


def _check_state(where: str, effect: Effect) -> tuple[float, ...]:
    """The state of an effect at a magnitude of zero, if it has one, seen to be finite and so its rate."""
    if effect.rate is None and effect.start is None:
        return ()
    if effect.rate is None or effect.start is None or effect.reading:
        raise InvalidExtensionError(
            f"{where}: a state needs both rate and start, beside a force or an actuation; give both or none"
        )
    moving = (0.1, 12.0, 0.02, 12.1, 0.05, 100.0, REFERENCE.constants(), 0.0)
    try:
        state = float(effect.start(*moving))
        rate = float(effect.rate(*moving, state))
    except Exception as error:
        raise InvalidExtensionError(f"{where}: its rate or start fails ({one_line(error)}); correct it") from None
    if not (math.isfinite(state) and math.isfinite(rate)):
        raise InvalidExtensionError(
            f"{where}: its state {state:g} or rate {rate:g} is not finite at a magnitude of zero; bound its divisor"
        )
    return (state,)


def physics(kind: str) -> list[tuple[str, Callable[..., Any]]]:
    """(name, function) of the installed effects that have a function of this kind (`force`, ..., `start`)."""
    pairs = [(name, getattr(effect, kind)) for name, effect in installed_effects().items()]
    return [(name, function) for name, function in pairs if function is not None]


def fingerprint(tyres: Mapping[str, Callable[..., Any]]) -> str:
    """What other packages' effects and tyres hash to: their names, delays and functions' sources; empty without any."""
    if not installed_effects() and not tyres:
        return ""
    digest = hashlib.sha256()
    for name, effect in installed_effects().items():
        digest.update(f"{name} {effect.delays} ".encode())
    for name, function in [*(pair for kind in FUNCTIONS for pair in physics(kind)), *tyres.items()]:
        source = sys.modules[function.__module__].__file__
        digest.update(name.encode() + (Path(source).read_bytes() if source else b""))
    return digest.hexdigest()[:16]
