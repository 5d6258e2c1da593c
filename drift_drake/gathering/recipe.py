"""Which model gathers information, and how: ours, or the paper's with one switch."""

import dataclasses
from pathlib import Path
from typing import Self

from drift_drake.gathering.config import GatheringConfig, as_in_paper
from drift_drake.model.checkpoint import paper_checkpoint


@dataclasses.dataclass(frozen=True)
class Recipe:
    """What every experiment that gathers is configured with."""

    checkpoint: Path | None = None
    """Of the learnt model; the shipped one without."""
    as_in_paper: bool = False
    """The paper's model (27,012 parameters, z alone, T = 10, four separate beliefs, 35 vehicles) and its information
    gathering: eq. (8) with one weight, Euler's path, no added bounds."""
    gathering: GatheringConfig = dataclasses.field(default_factory=GatheringConfig)

    def resolved(self) -> Self:
        """The configuration with what `as_in_paper` stands for."""
        if not self.as_in_paper:
            return self
        return dataclasses.replace(self, checkpoint=paper_checkpoint(), gathering=as_in_paper(self.gathering))
