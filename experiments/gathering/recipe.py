"""The paper's information gathering, and what every experiment that gathers is configured with."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Literal, Self

import pandas as pd

from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.gathering.config import GatheringConfig, lane
from drift_drake.drive.learnt.checkpoint import paper_checkpoint
from drift_drake.drive.qp.qp import QpMethod
from drift_drake.drive.reference.trajectory import Reference, straight_line

PAPER_ALPHA = 4.0  # [1/nat] of the paper's recipe; chosen by `experiments.gathering.alpha`


# What `as_in_paper` turns off, since the paper does not have it: the screen of measurements, the gate of the adapter's
# samples, plans from fresh guesses, the prediction over the delay, the safe stop, the interior-point method.
Extra = Literal["screening", "gate", "fresh_guesses", "delay", "safe_stop", "interior_point"]


def as_in_paper(
    config: GatheringConfig,
    alpha: float = PAPER_ALPHA,
    qp: QpMethod = "osqp",
    objective: Literal["eq8", "updated"] = "eq8",
) -> GatheringConfig:
    """Information gathering as in the paper: eq. (9) in every round with one weight, Euler's path, nothing bounded.

    Nothing else than convergence says then whether a plan is of a car's motion: one that has not converged is none.

    Args:
        alpha: weight of the information [1/nat], which the paper does not state; qp: the paper's solver.
        objective: "updated" for the total information along the horizon, which the paper tried too.
    """
    return dataclasses.replace(
        config, objective=objective, objective_later=objective, fixed_alpha=True, ends_straight=False, bounded=False,
        checks=False, path_step="euler", learn_lags=False, alpha=alpha, only_converged=True, qp=qp,
    )  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Recipe:
    """What every experiment that gathers is configured with."""

    checkpoint: Path | None = None
    """Of the learnt model; without, the shipped one, or the paper's."""
    as_in_paper: bool = False
    """The paper's model (27,012 parameters, z alone, T = 10, four separate beliefs, 35 vehicles) and its information
    gathering: eq. (9) with one weight, Euler's path, no added bounds; its controller, without what `keep` lists."""
    paper_objective: Literal["eq8", "updated"] = "eq8"
    """"updated": the total information along the horizon in place of eq. (9)'s sum."""
    keep: tuple[Extra, ...] = ()
    """Of what the paper has not, what the recipe keeps all the same."""
    paper_alpha: float = PAPER_ALPHA
    """Weight of the information in the paper's recipe, which has this in place of gathering.alpha."""
    gathering: GatheringConfig = dataclasses.field(default_factory=GatheringConfig)

    def resolved(self) -> Self:
        """The configuration with what `as_in_paper` stands for.

        Raises:
            InvalidOptionError: a weight that the recipe does not take.
        """
        if not self.as_in_paper:
            if self.keep:
                raise InvalidOptionError(f"--keep {self.keep[0]}: give --as-in-paper too; without it, all is kept")
            return self
        if self.gathering.alpha != GatheringConfig.alpha:
            raise InvalidOptionError(
                f"--gathering.alpha {self.gathering.alpha:g}: the paper's recipe has a weight of its own; "
                f"give --paper-alpha {self.gathering.alpha:g}"
            )
        qp = self.gathering.qp if "interior_point" in self.keep else "osqp"
        gathering = as_in_paper(self.gathering, self.paper_alpha, qp, self.paper_objective)
        return dataclasses.replace(self, checkpoint=self.checkpoint or paper_checkpoint(), gathering=gathering)


def lane_for_pictures(config: GatheringConfig, tables: Iterable[pd.DataFrame]) -> Reference:
    """The lane, as long as the farthest of drives: one that is faster than the reference leaves its end behind."""
    farthest = max(lane(config).distance, *(float(table["s"].max()) for table in tables))
    return straight_line(config.v_end, config.v_end, farthest / config.v_end, config.half_width)
