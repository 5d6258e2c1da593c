"""The physics of all installed effects as one function of each kind, compiled with the package's own."""

from collections.abc import Callable, Sequence
from typing import Any

from drift_drake.car.effects.installed import installed_effects, physics
from drift_drake.car.parameters import Constants
from drift_drake.car.scalar import jitable

Function = Callable[..., Any]


def joined_physics(
    effects: Sequence[str], memory: Sequence[str]
) -> tuple[Function, Function, Function, Function, Function]:
    """Actuation, force and reading of all installed effects, the rates of their states, and where these start.

    Args:
        effects, memory: names of the fields of `effects.Effects` and `effects.Memory`.
    """

    def chain(kind: str, nothing: Function, join: Callable[..., Function]) -> Function:
        total = jitable(nothing)
        for name, function in physics(kind):
            remembers = installed_effects()[name].rate and kind != "start"
            own = _own_numbers(effects.index(name), memory.index(name) if remembers else None)
            total = jitable(join(total, jitable(function), jitable(own)))
        return total

    return (
        chain("actuation", lambda delta, tau, v, q, memory: (delta, tau), _after),  # noqa: ARG005
        chain("force", lambda r, v, beta, omega_r, psi, car, q, memory: (0.0, 0.0, 0.0), _with_force),  # noqa: ARG005
        chain("reading", lambda r, beta, omega_r, q: (0.0, 0.0, 0.0), _with_error),  # noqa: ARG005
        chain("rate", lambda r, v, beta, omega_r, delta, tau, car, q, memory: (), _with_rate),  # noqa: ARG005
        chain("start", lambda r, v, beta, omega_r, delta, tau, car, q: (), _with_start),  # noqa: ARG005
    )


def _own_numbers(index: int, place: int | None) -> Function:
    """An effect's magnitude, and its state behind it where it has one."""
    if place is None:
        return lambda q, memory: (q[index],)  # noqa: ARG005
    return lambda q, memory: (q[index], memory[place])


def _after(before: Any, change: Any, own: Any) -> Function:
    def actuation(delta: Any, tau: Any, v: Any, q: Any, memory: Any) -> Any:
        angle, torque = before(delta, tau, v, q, memory)
        return change(angle, torque, v, *own(q, memory))

    return actuation


def _with_force(before: Any, force: Any, own: Any) -> Function:
    def total(r: Any, v: Any, beta: Any, omega_r: Any, psi: Any, car: Constants, q: Any, memory: Any) -> Any:
        x, y, moment = before(r, v, beta, omega_r, psi, car, q, memory)
        more_x, more_y, more_moment = force(r, v, beta, omega_r, psi, car, *own(q, memory))
        return x + more_x, y + more_y, moment + more_moment

    return total


def _with_error(before: Any, reading: Any, own: Any) -> Function:
    def total(r: Any, beta: Any, omega_r: Any, q: Any) -> Any:
        errors, more = before(r, beta, omega_r, q), reading(r, beta, omega_r, *own(q, ()))
        return errors[0] + more[0], errors[1] + more[1], errors[2] + more[2]

    return total


def _with_rate(before: Any, rate: Any, own: Any) -> Function:
    def rates(
        r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, car: Constants, q: Any, memory: Any
    ) -> Any:
        others = before(r, v, beta, omega_r, delta, tau, car, q, memory)
        return others + (rate(r, v, beta, omega_r, delta, tau, car, *own(q, memory)) + 0.0 * r,)  # noqa: RUF005

    return rates


def _with_start(before: Any, start: Any, own: Any) -> Function:
    def starts(r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, car: Constants, q: Any) -> Any:
        others = before(r, v, beta, omega_r, delta, tau, car, q)
        return others + (start(r, v, beta, omega_r, delta, tau, car, *own(q, ())) + 0.0 * r,)  # noqa: RUF005

    return starts
