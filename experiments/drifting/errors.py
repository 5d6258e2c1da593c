"""How wrong beliefs are where a vehicle drifts, also after its other drives were learnt from: the best to hope for."""

from typing import Any

import numpy as np

from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.features import INPUT_SCALE, STATE_COUNT
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.drive.learnt.quality import learn, step_model
from drift_drake.drive.learnt.samples import DRIFTING, Samples, concatenate
from experiments.model.judging import rollout_errors, step_errors

ROLLOUT_STEPS = 20  # 2 s
EVERY = 5  # samples from one rollout's start to the next


def drifting_errors(model: BayesianModel, belief: Posterior, samples: Samples) -> dict[str, Any]:
    """A belief's errors where a vehicle's drives drift.

    Returns:
        "one_step": RMS error by state [4]; "rollout": median size of the error after 2 s under the recorded commands by
        state [4], NaN where no drift lasts as long; "one_step_scaled": root mean square over states of the RMS errors
        in units of the model's noise; "rollout_scaled": the same of the rollouts' medians in units of the features'
        input scale.
    """
    stepper = step_model(model, belief)
    drifting = samples.where(np.abs(samples.x[:, 2]) > DRIFTING)
    one_step = np.sqrt(np.mean(step_errors(stepper, drifting)[:, :STATE_COUNT] ** 2, axis=0))
    long = [drive for drive in samples.drives() if len(drive.x) >= ROLLOUT_STEPS]
    starts = np.concatenate([drive.x[: len(drive.x) - ROLLOUT_STEPS + 1 : EVERY, 2] for drive in long])
    errors = rollout_errors(stepper, long, ROLLOUT_STEPS, EVERY)[np.abs(starts) > DRIFTING]
    rollout = np.median(np.abs(errors[:, :STATE_COUNT]), axis=0) if len(errors) else np.full(STATE_COUNT, np.nan)
    return {
        "one_step": one_step,
        "rollout": rollout,
        "one_step_scaled": float(np.sqrt(np.mean((one_step / model.sigma) ** 2))),
        "rollout_scaled": float(np.sqrt(np.mean((rollout / INPUT_SCALE[:STATE_COUNT]) ** 2))),
    }


def judged_by_halves(
    model: BayesianModel, beliefs: dict[str, Posterior], samples: Samples
) -> dict[str, dict[str, float]]:
    """Errors on half of a vehicle's drives, and those after learning from the other half: the best to be hoped for.

    Each half judges once; of the two the root mean square is taken (2 s: over those with drifts that last as long).

    Args:
        beliefs: from elsewhere; samples: of one vehicle's drives.

    Returns:
        "one_step" and "rollout" (scaled, see `drifting_errors`) of each of the beliefs and of it with the other half
        learnt from too (`... and own drives`).
    """
    drives = samples.drives()
    halves = [concatenate(drives[0::2]), concatenate(drives[1::2])]
    found: dict[str, list[dict[str, Any]]] = {}
    for judged, other in (halves, halves[::-1]):
        for name, belief in beliefs.items():
            found.setdefault(name, []).append(drifting_errors(model, belief, judged))
            informed = learn(model, belief, other)
            found.setdefault(f"{name} and own drives", []).append(drifting_errors(model, informed, judged))
    return {
        name: {kind: _mean_size([error[f"{kind}_scaled"] for error in errors]) for kind in ("one_step", "rollout")}
        for name, errors in found.items()
    }


def _mean_size(errors: list[float]) -> float:
    """Root mean square of those that are numbers."""
    known = np.array(errors)[np.isfinite(errors)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")
