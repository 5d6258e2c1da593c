"""The physics of the effects' records as one function of each kind, compiled with the cars' equations."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import Constants
from drift_drake.car.scalar import anywhere, jitable

Function = Callable[..., Any]


def joined_physics(effects: Sequence[str], internal: Sequence[str]) -> tuple[Function, ...]:
    """Actuation and errors of readings of all effects, the rates of their states and where these start; a wrench
    with the further forces on a single-track and on a double-track car.

    Args:
        effects, internal: names of the fields of `effects.Effects` and `effects.InternalStates`.
    """

    def chain(kind: str, nothing: Function, join: Callable[..., Function], left_out: Sequence[str] = ()) -> Function:
        total = jitable(nothing)
        for name, effect in CATALOGUE.items():
            function = getattr(effect, kind)
            if function is None or effect.double_track in left_out:
                continue
            state = internal.index(name) if effect.rate else None
            total = jitable(join(total, jitable(function), effects.index(name), state))
        return total

    return (
        chain("actuation", lambda delta, tau, v, q, internal: (delta, tau), _after),
        chain("reading", lambda r, beta, omega_r, q: (0.0, 0.0, 0.0), _with_error),
        chain("rate", lambda r, v, beta, omega_r, delta, tau, car, q, internal: (), _with_rate),
        chain("start", lambda r, v, beta, omega_r, delta, tau, car, q: (), _with_start),
        _forces(effects, internal, ()),
        _forces(effects, internal, ("parameter", "nothing")),
    )


def _forces(effects: Sequence[str], internal: Sequence[str], left_out: Sequence[str]) -> Function:
    """A wrench with the forces added; written out, since in a chain each function costs a compilation."""
    known = dict[str, Function]()
    lines = ["def total(r, v, beta, omega_r, psi, car, q, internal, wrench):", "x, y, m = wrench"]
    for name, effect in CATALOGUE.items():
        if effect.force is not None and effect.double_track not in left_out:
            known[name] = jitable(effect.force)
            state = f", internal[{internal.index(name)}]" if effect.rate else ""
            lines.append(f"x_, y_, m_ = {name}(r, v, beta, omega_r, psi, car, q[{effects.index(name)}]{state})")
            lines.append("x, y, m = x + x_, y + y_, m + m_")
    exec("\n    ".join([*lines, "return x, y, m"]), known)
    return jitable(known["total"])


def over(places: Iterable[int], nothing: Any, join: Callable[[Function, int], Function]) -> Function:
    """A function of all magnitudes: `nothing`, joined with those at these places (`plus`, `or_there`)."""
    total = jitable(lambda q: nothing)
    for place in places:
        total = jitable(join(total, place))
    return total


def plus(before: Function, place: int) -> Function:
    return lambda q: before(q) + q[place]


def or_there(before: Function, place: int) -> Function:
    return lambda q: before(q) or anywhere(q[place])


def _own_numbers(index: int, place: int | None) -> Function:
    """An effect's magnitude, and its state behind it where it has one."""
    if place is None:
        return jitable(lambda q, internal: (q[index],))
    return jitable(lambda q, internal: (q[index], internal[place]))


def _after(before: Any, change: Any, index: int, place: int | None) -> Function:
    own = _own_numbers(index, place)

    def actuation(delta: Any, tau: Any, v: Any, q: Any, internal: Any) -> Any:
        angle, torque = before(delta, tau, v, q, internal)
        return change(angle, torque, v, *own(q, internal))

    return actuation


def _with_error(before: Any, reading: Any, index: int, _: None) -> Function:
    def total(r: Any, beta: Any, omega_r: Any, q: Any) -> Any:
        errors, more = before(r, beta, omega_r, q), reading(r, beta, omega_r, q[index])
        return errors[0] + more[0], errors[1] + more[1], errors[2] + more[2]

    return total


def _with_rate(before: Any, rate: Any, index: int, place: int) -> Function:
    def rates(
        r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, car: Constants, q: Any, internal: Any
    ) -> Any:
        others = before(r, v, beta, omega_r, delta, tau, car, q, internal)
        return others + (rate(r, v, beta, omega_r, delta, tau, car, q[index], internal[place]) + 0.0 * r,)  # noqa: RUF005

    return rates


def _with_start(before: Any, start: Any, index: int, _: int) -> Function:
    def starts(r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, car: Constants, q: Any) -> Any:
        others = before(r, v, beta, omega_r, delta, tau, car, q)
        return others + (start(r, v, beta, omega_r, delta, tau, car, q[index]) + 0.0 * r,)  # noqa: RUF005

    return starts
