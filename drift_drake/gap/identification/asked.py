"""What an identification is asked for."""

import dataclasses
from collections.abc import Mapping, Sequence

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.gap.identification.options import CarKind, Criterion


@dataclasses.dataclass(frozen=True)
class Asked:
    """What is asked of an identification; see `identify`."""

    first: CarParameters
    effects: Effects
    case: str
    known: tuple[str, ...]
    names: tuple[str, ...]
    stated: Mapping[str, float] | None
    criterion: Criterion
    tolerances: frozenset[str]
    kind: CarKind = "auto"
    unseen: tuple[str, ...] = ()  # parameters (names of tolerances) that the drives cannot show

    @property
    def vehicle(self) -> VehicleParameters:
        """The single-track car of the first guess, or the nearest."""
        return self.first.single_track()

    def without_unseen(self, names: Sequence[str]) -> list[str]:
        """Effects of these names that the drives may show."""
        return [name for name in names if not ("friction" in self.unseen and CATALOGUE[name].at_the_limit)]
