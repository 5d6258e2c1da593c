"""What to ask instead of a drift that a car cannot drive: found by trying, and said in one sentence."""

from collections.abc import Callable, Iterator

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.reference.chain import NoTransitionError
from drift_drake.drive.reference.equilibrium import NoEquilibriumError

CANNOT = (NoEquilibriumError, NoTransitionError, ValueError)
FRICTIONS = (1.25, 1.5, 2.0, 3.0, 5.0, 8.0, 15.0)  # times the car's own
HIGHEST_FRICTION = 1.3  # of a road
LONGER = (1.25, 1.5, 2.0, 3.0)  # times the transition
SMALLER = (0.8, 0.6, 0.4)  # times the sideslip
WIDER = (1.5, 2.0, 3.0)  # times the radius, and the transition

Asked = tuple[float, float, float]  # radius [m], sideslip [rad], transition [m]


def instead(plan: Callable[[VehicleParameters, Asked], object], p: VehicleParameters, asked: Asked, why: str) -> str:
    """Why a drift cannot be driven, with the fix.

    Args:
        plan: raises one of `CANNOT` where a car cannot drive what is asked; why: what it said of this car.
    """
    radius, sideslip, transition = asked
    why = why.removesuffix("; give more distance")
    fix = next((words for other, words in _others(asked) if _works(plan, p, other)), "give another car or road")
    enough = (factor * p.friction for factor in FRICTIONS if factor * p.friction <= HIGHEST_FRICTION)
    least = next((friction for friction in enough if _works(plan, p.replace(friction=friction), asked)), None)
    if least is None:
        return f"{why}; {fix}"
    return (
        f"a friction of {p.friction:.3g} is too low for drifts of {sideslip:.3g} rad of sideslip round {radius:.3g} m "
        f"with transitions of {transition:.3g} m (one of {least:.2g} is enough): {fix}"
    )


def _others(asked: Asked) -> Iterator[tuple[Asked, str]]:
    """What may be asked in place of it, the nearest first, and in words."""
    radius, sideslip, transition = asked
    longer = [(radius, sideslip, factor * transition) for factor in LONGER]
    smaller = [(radius, factor * sideslip, more * transition) for factor in SMALLER for more in (1.0, 1.5)]
    wider = [(factor * radius, sideslip, factor * transition) for factor in WIDER]
    for other in (*longer, *smaller, *wider):
        names = ("radius", "sideslip", "transition")
        changed = [(name, new) for name, new, old in zip(names, other, asked, strict=True) if new != old]
        yield other, "give " + " ".join(f"--{name} {value:.3g}" for name, value in changed)


def _works(plan: Callable[[VehicleParameters, Asked], object], p: VehicleParameters, asked: Asked) -> bool:
    try:
        plan(p, asked)
    except CANNOT:
        return False
    return True
