"""The catalogue of effects: a record each, the package's own, a file a family, and those that other packages install.

Errors of the sensors and further forces have their physics here, as those of another package have; delays, factors on
a reading and changed parameters are said by the record alone. What else tyres, loads and actuators do is in the cars'
equations.
"""

from collections.abc import Iterable

from drift_drake.car.effects.catalogue.actuators import ACTUATORS
from drift_drake.car.effects.catalogue.body import BODY
from drift_drake.car.effects.catalogue.forces import FORCES
from drift_drake.car.effects.catalogue.sensors import SENSORS
from drift_drake.car.effects.catalogue.tyres import TYRES
from drift_drake.car.effects.installed import installed_effects
from drift_drake.car.effects.manoeuvres import MANOEUVRES
from drift_drake.car.effects.record import REFERENCE, Effect, Fit, InvalidExtensionError, wheelbase

__all__ = ["CATALOGUE", "HEADED", "LIMITS", "OFF_THE_MOTION", "PARAMETRIC", "REFERENCE", "Effect",
           "fitted", "shown_by", "wheelbase"]  # fmt: skip

FAMILIES = TYRES | BODY | ACTUATORS | FORCES | SENSORS
OWN = dict(sorted(FAMILIES.items(), key=lambda item: item[1].since))

if twice := sorted(set(OWN) & set(installed_effects())):
    raise InvalidExtensionError(f"effect {', '.join(twice)}: is in the catalogue already; give yours another name")

CATALOGUE: dict[str, Effect] = OWN | installed_effects()
"""All effects by name, the package's own and those that other packages install.

Examples:
    >>> [name for name, effect in CATALOGUE.items() if effect.stage == "command"]
    ['steering_delay', 'command_clock_error']
"""

OFF_THE_MOTION = tuple(name for name, effect in CATALOGUE.items() if effect.stage in ("command", "sensor"))
"""Effects that act before the plant (transport delays) or after it (the sensors'), never on its motion."""
PARAMETRIC = frozenset(name for name, effect in CATALOGUE.items() if effect.tolerance and effect.stage == "motion")
"""Effects that only change a car's constants: nothing of its motion then depends on internal states."""
HEADED = frozenset(name for name, effect in CATALOGUE.items() if effect.force and "psi" in effect.needs)
"""Effects by which the motion depends on the heading."""
LIMITS = frozenset(name for name, effect in CATALOGUE.items() if effect.limit)
"""Upper limits: effects that act more the smaller their magnitude is."""


def shown_by(effects: Iterable[str]) -> list[tuple[str, list[str]]]:
    """Manoeuvres that show some of the effects, each with those."""
    asked = set(effects)
    shown = {name: effect.shown_by for name, effect in CATALOGUE.items() if name in asked and effect.shown_by}
    words = dict.fromkeys((*MANOEUVRES, *shown.values()))
    parts = [(one, [name for name in shown if shown[name] == one]) for one in words]
    return [(one, names) for one, names in parts if names]


def fitted(fit: Fit) -> tuple[str, ...]:
    """Effects that a method looks for unasked."""
    return tuple(name for name, effect in CATALOGUE.items() if fit in effect.fitted)
