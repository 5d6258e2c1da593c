"""The catalogue of effects: a record each, the package's own, a file a family, and those that other packages install.

The physics of the package's own is in `single_track.motion_with_effects`, but for delays of commands, of which the
record says all (`delays`); that of another package's is beside its record.
"""

from drift_drake.car.effects.catalogue.actuators import ACTUATORS
from drift_drake.car.effects.catalogue.body import BODY
from drift_drake.car.effects.catalogue.forces import FORCES
from drift_drake.car.effects.catalogue.sensors import SENSORS
from drift_drake.car.effects.catalogue.tyres import TYRES
from drift_drake.car.effects.installed import installed_effects
from drift_drake.car.effects.record import REFERENCE, Effect, Fit, InvalidExtensionError, wheelbase

__all__ = ["CATALOGUE", "LIMITS", "OFF_THE_MOTION", "REFERENCE", "Effect", "fitted", "wheelbase"]

FAMILIES = TYRES | BODY | ACTUATORS | FORCES | SENSORS
OWN = dict(sorted(FAMILIES.items(), key=lambda item: item[1].since))

if twice := sorted(set(OWN) & set(installed_effects())):
    raise InvalidExtensionError(f"effect {', '.join(twice)}: is in the catalogue already; give yours another name")

CATALOGUE: dict[str, Effect] = OWN | installed_effects()

OFF_THE_MOTION = tuple(name for name, effect in CATALOGUE.items() if effect.stage in ("command", "sensor"))
"""Effects that act before the plant (transport delays) or after it (the sensors'), never on its motion."""
LIMITS = frozenset(name for name, effect in CATALOGUE.items() if effect.limit)
"""Effects that act the more the lower they are."""


def fitted(fit: Fit) -> tuple[str, ...]:
    """Effects that a method looks for unasked."""
    return tuple(name for name, effect in CATALOGUE.items() if fit in effect.fitted)
