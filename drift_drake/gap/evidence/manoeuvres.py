"""Which manoeuvre shows which effect: what to drive where logs cannot tell."""

from collections.abc import Iterable

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.manoeuvres import MANOEUVRES


def shown_by(effects: Iterable[str]) -> list[tuple[str, list[str]]]:
    """Manoeuvres that show some of the effects, each with those."""
    asked = set(effects)
    shown = {name: effect.shown_by for name, effect in CATALOGUE.items() if name in asked and effect.shown_by}
    words = dict.fromkeys((*MANOEUVRES, *shown.values()))
    parts = [(one, [name for name in shown if shown[name] == one]) for one in words]
    return [(one, names) for one, names in parts if names]
