"""Which effects these logs could tell apart, and which they do not excite, from the innovations' derivatives."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import MAGNITUDE_STEP, Fit, parameter_limits, prior_precision, run_sensitivity
from drift_drake.gap.estimation.observed import observe_each
from drift_drake.gap.estimation.prior import REACH, RELATIVE_TO_NONE, named_from, scale, starts
from drift_drake.gap.estimation.problem import Gains, Problem, counted
from drift_drake.gap.estimation.variants import Variant

SMALL = 0.05  # of an effect's scale


@dataclasses.dataclass(frozen=True)
class Isolability:
    """Effects' signatures at a fit, with the tolerances projected out."""

    names: tuple[str, ...]
    likeness: np.ndarray  # [effects, effects] absolute cosine between signatures
    deviation: np.ndarray  # [effects] standard deviation that a magnitude would get, in the catalogue's units

    def unexcited(self) -> list[str]:
        """Effects whose whole practical range is within two standard deviations."""
        return [
            name
            for name, sigma in zip(self.names, self.deviation, strict=True)
            if 2.0 * sigma > max(abs(CATALOGUE[name].low), abs(CATALOGUE[name].high))
        ]

    def limits(self, vehicle: VehicleParameters) -> dict[str, dict[str, object]]:
        """By effect the least magnitude that would be named with 95 % probability, as an answer's `details.detection`.

        To first order in the magnitude: it must be far enough from zero, and from what the effect most like it can do.
        A steering rate limit, which acts more the smaller it is, is left out.
        """
        out: dict[str, dict[str, object]] = {}
        alike = self.likeness - np.eye(len(self.names))
        shifts = named_from(alike.max(axis=1))
        for i, name in enumerate(self.names):
            if name in LIMITS:
                continue
            rival = int(np.argmax(alike[i]))
            least = float(self.deviation[i] * shifts[i])
            info = CATALOGUE[name]
            within = least <= REACH * max(abs(end) for end in info.range_for(vehicle))
            taken_for = self.names[rival] if shifts[i] > RELATIVE_TO_NONE else "none"
            out[name] = {"unit": info.unit, "least": least if within else None, "taken_for": taken_for}
        return out


def isolability(problem: Problem, fit: Fit, names: Sequence[str], small: bool = False) -> Isolability:
    """Signatures of all effects at a fit: derivatives of the innovations at a middling magnitude.

    Where they are `small`, a step from zero: a tolerance of the vehicle file may then do what an effect does.
    """
    gains, nuisances = filter_case(problem, fit.theta, fit.names), problem.nuisances
    information, cross = np.zeros((len(names), len(names))), np.zeros((nuisances, len(names)))
    own = np.diag(prior_precision(problem, nuisances))
    for i in range(len(problem.runs)):
        block, columns = run_sensitivity(problem, gains, fit.theta, fit.names, i)
        block, columns = block[:, columns < nuisances], columns[columns < nuisances]
        signatures = np.stack([_signature(problem, gains, fit, name, small, i) for name in names], axis=-1)
        own[np.ix_(columns, columns)] += block.T @ block
        cross[columns] += block.T @ signatures
        information += signatures.T @ signatures
    # Information that is left about the magnitudes once the nuisances are fitted, each within its prior.
    information = information - cross.T @ np.linalg.solve(own, cross)
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    return Isolability(tuple(names), np.abs(information) / np.outer(size, size), 1.0 / size)


def _signature(problem: Problem, gains: Gains, fit: Fit, name: str, small: bool, index: int) -> np.ndarray:
    """What a unit of one effect does to one run's innovations that count."""
    names = fit.names if name in fit.names else (*fit.names, name)
    begin = 0.0 if small and name not in LIMITS else starts(name, problem.vehicle)[0]
    theta = fit.theta if name in fit.names else np.append(fit.theta, begin)
    at = names.index(name) + problem.nuisances
    step = (SMALL if small else MAGNITUDE_STEP) * scale(name, problem.vehicle)
    step = step if theta[at] + step <= parameter_limits(problem, names)[1][at] else -step
    moved = theta.copy()
    moved[at] += step
    ends = observe_each(problem, gains, index, [Variant(moved, names), Variant(theta, names)])
    found = counted(problem, problem.runs[index], ends[0] - ends[1]).ravel() / step
    if np.all(np.isfinite(found)):
        return found
    # A small car's tyres settle faster, with a relaxation length near zero, than a row's steps can follow.
    return _signature(problem, gains, fit, name, False, index) if small else np.zeros_like(found)
