"""Derivatives of a case's innovations by a fit's parameters, run by run, and the normal equations that they give.

Each run has two parameters of its own, its commands before the first row, by which no other run's innovations move:
the rows of the derivatives are kept run by run, without the columns that are zero there. So what is kept grows with
the length of the logs, not with their length times the number of runs.
"""

import dataclasses
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np


@dataclasses.dataclass(frozen=True)
class Derivatives:
    """The derivatives J [count, parameters], by blocks."""

    blocks: Sequence[np.ndarray]  # of each run [its count, its columns]
    columns: Sequence[np.ndarray]  # parameters that the columns of each run's block are of
    parameters: int

    @cached_property
    def information(self) -> np.ndarray:
        """J'J [parameters, parameters]."""
        out = np.zeros((self.parameters, self.parameters))
        for block, columns in zip(self.blocks, self.columns, strict=True):
            out[np.ix_(columns, columns)] += block.T @ block
        return out

    def pull(self, e: np.ndarray) -> np.ndarray:
        """J'e [parameters] of innovations e [count]."""
        out = np.zeros(self.parameters)
        for block, columns, part in zip(self.blocks, self.columns, self.by_run(e), strict=True):
            out[columns] += block.T @ part
        return out

    def by_run(self, e: np.ndarray) -> Iterator[np.ndarray]:
        """The parts of e [count, ...] that are of each run."""
        at = 0
        for block in self.blocks:
            yield e[at : at + len(block)]
            at += len(block)

    def rows(self, kept: Sequence[np.ndarray]) -> "Derivatives":
        """Those of some of each run's innovations [its count] bool."""
        blocks = [block[mask] for block, mask in zip(self.blocks, kept, strict=True)]
        return Derivatives(blocks, self.columns, self.parameters)

    def bordered(self, last: np.ndarray) -> np.ndarray:
        """The information [parameters + 1, parameters + 1] with one more parameter, of derivatives `last` [count]."""
        cross = np.append(self.pull(last), last @ last)
        out = np.empty((len(cross), len(cross)))
        out[:-1, :-1], out[-1], out[:, -1] = self.information, cross, cross
        return out

    def dense(self) -> np.ndarray:
        """J [count, parameters]."""
        out = np.zeros((sum(len(block) for block in self.blocks), self.parameters))
        for part, block, columns in zip(self.by_run(out), self.blocks, self.columns, strict=True):
            part[:, columns] = block
        return out
