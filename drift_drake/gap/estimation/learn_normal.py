"""The baseline residual distribution of a car, learnt from the logs of its calibration."""

from typing import NamedTuple

import numpy as np

from drift_drake.car.equations import kind_of
from drift_drake.gap.estimation.baseline import seen_of, spread_of, with_partial
from drift_drake.gap.estimation.lost_blocks import lost_blocks, transitions
from drift_drake.gap.estimation.noise_levels import log_levels
from drift_drake.gap.estimation.normal import Normal, capped_squares
from drift_drake.gap.estimation.prediction_constants import CALIBRATED, MODEL_FORM, REGULAR
from drift_drake.gap.estimation.recordings_left_out import LeftOut, learnt_from
from drift_drake.gap.estimation.robust_fit import robust_scales
from drift_drake.gap.estimation.scores import (
    Day,
    drive_coverage,
    flat_scores,
    pulls,
    scores_by_recording,
    shrunk,
    spread,
)


class Learnt(NamedTuple):
    """What a day of calibration shows of its car."""

    normal: Normal
    pulled: np.ndarray  # by how much each recording pulls the effects, in units [recordings, n]
    left_out: list[LeftOut]  # its recordings, or the stretches of its only one


def learn_normal(
    day: Day, names: tuple[str, ...], steps: np.ndarray, prior: np.ndarray, between: np.ndarray, left: np.ndarray
) -> Learnt:
    """The baseline residual distribution, from the logs of the calibration.

    Args:
        day: the logs that the car was calibrated on, under the calibrated car; steps: units of the effects `names`;
        prior: standard deviations [n] of the effects, in their units, before those logs; between: the same of what
            they differ by from one recording to the next at least (`between_recordings`); left: what the car may
            deviate by (`left_of`).
    """
    n, of_kind = len(names), tuple(kind_of(day.constants).deviations)
    scales = robust_scales(day.errors)
    f = flat_scores(day.errors, scales)
    precision = np.linalg.inv(np.cov(f.T) + REGULAR * np.eye(f.shape[1]))
    seen = seen_of(day, scales, precision)
    total, model = seen.stretches.information.sum(axis=0), spread_of(seen, names, between, len(of_kind))
    before = with_partial(left, len(total), len(of_kind))
    shown = learnt_from(seen.stretches, model, before)
    distances = np.array([part.distance for part in shown.left_out])
    unknown, recording, pulled = parameters_left_open(day, seen.score[:, :n], total[:n, :n], prior, between, names,
                                                      steps)  # fmt: skip
    offset = np.median(day.errors, axis=0)
    lost = lost_blocks(day.errors, offset, scales, day.block)
    normal = Normal(
        names=tuple(names), of_kind=of_kind, kind_units=day.kind_units,
        stride=day.runs[0].stride, units=steps, scales=scales, precision=precision,
        standard=day.standard, slipping=seen.slipping, lost=transitions(lost, day.block, day.run),
        covariance=seen.covariance, information=seen.information, ratio=seen.ratio, expected=shown.known.mean,
        left_open=shown.known.covariance, least_deviations=between, factors=shown.factors, scale=shown.scale,
        left_out=distances, left_out_none=np.ones(len(distances)), covered=drive_coverage(day.runs),
        unknown=unknown, recording=recording,
        offset=offset, level=capped_squares((day.errors - offset) / scales).mean(axis=0),
        noise=log_levels(day.runs, white=True),
    )  # fmt: skip
    return Learnt(normal, pulled, shown.left_out)


def parameters_left_open(
    day: Day, score: np.ndarray, information: np.ndarray, prior: np.ndarray, between: np.ndarray,
    names: tuple[str, ...], steps: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Covariance of what a baseline leaves unknown of the effects and of what they differ by from recording to
    recording [n, n], and what each recording pulls the estimates by [K, n]; in units.

    Args:
        score: of the blocks [blocks, n]; information: of the whole day [n, n].
    """
    variances = np.diag(np.cov(score.T) if len(score) > 2 else np.maximum(np.cov(score.T), 0.0))
    seen = np.diag(information) > 0.0
    ratio = float(np.mean(variances[seen] * len(score) / np.diag(information)[seen]))
    temper = max(ratio, 1.0) * CALIBRATED
    alone = np.linalg.inv(np.diag(1.0 / prior**2) + information / temper)
    by_recording, blocks = scores_by_recording(day, score)
    pulled = pulls(by_recording / temper, blocks, alone)
    model_form = np.diag((np.array([MODEL_FORM.get(name, 0.0) for name in names]) / steps) ** 2)
    seen_apart = spread(pulled)
    # Blocks' scatter alone pulls recordings apart by a share of what is left open that is their number over CALIBRATED.
    chance = len(pulled) / CALIBRATED
    recording = shrunk(seen_apart, alone, information / temper, len(pulled), chance) + np.diag(between**2)
    return alone + model_form + recording / len(pulled), recording, pulled
