"""The baseline residual distribution of a calibrated car, and its place in a calibration's file."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.common.errors import shown
from drift_drake.common.plain_files import number
from drift_drake.gap.estimation.partial import DRIVING, partial_effects
from drift_drake.gap.estimation.prediction_constants import FACTORS
from drift_drake.gap.estimation.windows import HORIZONS, PREDICTED, STRIDE

WORST = 9.0  # mean squares, in robust scales, at which a window's error is capped
LOST = 1e4  # the same of what is shown and located: a prediction a hundred normal errors off
LARGEST_LOGARITHM = 100.0
LARGEST_NUMBER = 1e100  # of a calibration's file: beyond, its squares are not finite
ROUNDED = 1e-6  # of a matrix's largest entry, by which rounding may make an eigenvalue negative


def capped_squares(e: np.ndarray, cap: float = WORST) -> np.ndarray:
    """Squares of errors in scales, capped: a prediction that far off is lost, however far."""
    return np.asarray(np.minimum(e**2, cap))


@dataclasses.dataclass(frozen=True)
class Normal:
    """The baseline residual distribution of a calibrated car. Scores are in `units` of the effects `names`, then of the
    partial effects of these (`gap.estimation.partial`) and of deviations of its kind (`car.deviation`), m in all."""

    names: tuple[str, ...]
    of_kind: tuple[str, ...]  # deviations of the car's kind, behind the partial effects
    kind_units: np.ndarray  # of these [k] in standard deviations
    stride: float  # [s] between horizons
    units: np.ndarray  # [n]
    scales: np.ndarray  # [HORIZONS, channels]
    precision: np.ndarray  # of errors in scales [HORIZONS * channels, the same]
    standard: np.ndarray  # of the driving [2, DRIVING] (`partial.standards`)
    slipping: float  # how much tyres slipped (`baseline.slipping_of`)
    lost: np.ndarray  # transitions [2, 2] between blocks that are followed and lost (`lost_blocks`)
    covariance: np.ndarray  # of scores from block to block [m, m]
    information: np.ndarray  # diagonal of a block's information [m]
    ratio: float  # of that scatter to the one that the information tells of
    expected: np.ndarray  # what the car always deviates by, as far as its baseline tells [m]
    left_open: np.ndarray  # covariance of that [m, m]
    least_deviations: (
        np.ndarray
    )  # standard deviations of the effects from recording to recording, whatever was seen, in units [n]
    factors: np.ndarray  # log probabilities of the factors on what equations lack from stretch to stretch [K]
    scale: float  # of the scatter of another recording's scores, learnt from recordings left out
    left_out: np.ndarray  # of each recording left out, the squared distance from what the others predict, per score [K]
    left_out_none: np.ndarray  # and the probability that it has no gap [K]
    covered: np.ndarray  # how hard the car was driven [4] (`windows.regimes`)
    unknown: np.ndarray  # covariance of what calibration left unknown of the effects, in units [n, n]
    recording: np.ndarray  # covariance of the effects from one recording to the next, in units [n, n]
    offset: np.ndarray  # median errors [HORIZONS, channels]
    level: np.ndarray  # mean squared errors about them, in scales and capped [HORIZONS, channels]
    noise: np.ndarray  # logarithms of the white noise of each recording's channels [K, channels] (`noise_levels`)

    @property
    def blocks(self) -> int:
        """Number of blocks of the baseline."""
        return int(self.lost.sum())

    @property
    def main(self) -> int:
        """Index of the most probable factor."""
        return int(np.argmax(self.factors))

    def squares(self, e: np.ndarray, cap: float = WORST) -> np.ndarray:
        """Capped squares of errors [windows, HORIZONS, channels] about the normal ones, in scales."""
        return capped_squares((e - self.offset) / self.scales, cap)

    def as_data(self) -> dict[str, object]:
        """Plain lists, the inverse of `normal_from_data`."""
        return {key: value.tolist() if isinstance(value, np.ndarray) else value
                for key, value in dataclasses.asdict(self).items()}  # fmt: skip


def normal_from_data(data: Mapping[str, object]) -> Normal:
    """What `Normal.as_data` wrote; KeyError, TypeError or ValueError where it is not that."""
    arrays = {f.name: data[f.name] for f in dataclasses.fields(Normal)}
    names, of_kind = (tuple(str(name) for name in arrays.pop(key)) for key in ("names", "of_kind"))  # type: ignore[attr-defined]
    stride = number(arrays.pop("stride"), lambda seconds: 0.0 < seconds <= STRIDE)
    ratio, scale = (number(arrays.pop(key), lambda q: 0.0 < q < LARGEST_NUMBER) for key in ("ratio", "scale"))
    slipping = number(arrays.pop("slipping"), lambda q: abs(q) < LARGEST_LOGARITHM)
    try:
        out = Normal(
            names=names,
            of_kind=of_kind,
            stride=stride,
            ratio=ratio,
            scale=scale,
            slipping=slipping,
            **{key: np.array(value, dtype=float) for key, value in arrays.items()},
        )
    except OverflowError:
        raise ValueError("normal holds a number that is out of range") from None
    _check_normal(out)
    return out


def _check_normal(normal: Normal) -> None:
    """ValueError where numbers are missing, not finite or of a wrong sign, or a name is no effect's."""
    names, n, m = normal.names, len(normal.names), HORIZONS * len(PREDICTED)
    unknown = [name for name in names if name not in CATALOGUE]
    if unknown or not n or len(set(names)) < n:
        raise ValueError(f"'names' must be different effects of the catalogue, not {shown(unknown or list(names))}")
    scores, recordings = n + len(partial_effects(names)) + len(normal.of_kind), max(normal.left_out.size, 0)
    shapes: dict[str, tuple[int, ...]] = {"covered": (4,), "precision": (m, m), "scales": (HORIZONS, len(PREDICTED))}
    shapes |= {
        "units": (n,),
        "kind_units": (len(normal.of_kind),),
        "least_deviations": (n,),
        "factors": (len(FACTORS),),
        "standard": (2, len(DRIVING)),
        "left_out": (recordings,),
        "left_out_none": (recordings,),
        "noise": (len(normal.noise), len(PREDICTED)),
        "lost": (2, 2),
    }
    shapes |= dict.fromkeys(("expected", "information"), (scores,))
    shapes |= dict.fromkeys(("covariance", "left_open"), (scores, scores))
    shapes |= dict.fromkeys(("unknown", "recording"), (n, n))
    shapes |= dict.fromkeys(("offset", "level"), shapes["scales"])
    for key, shape in shapes.items():
        if getattr(normal, key).shape != shape or not np.all(np.abs(getattr(normal, key)) < LARGEST_NUMBER):
            raise ValueError(f"'{key}' must hold {shape} finite numbers")
    for key in ("units", "kind_units", "scales", "standard"):
        if np.min(getattr(normal, key)[-1] if key == "standard" else getattr(normal, key), initial=1.0) <= 0.0:
            raise ValueError(f"'{key}' must be above zero")
    for key in ("information", "covered", "level", "left_out", "left_out_none", "lost"):
        if np.min(getattr(normal, key), initial=0.0) < 0.0:
            raise ValueError(f"'{key}' must be zero or more")
    if np.any(normal.lost != np.round(normal.lost)) or normal.blocks < 1:
        raise ValueError("'lost' must hold whole numbers, one or more in all")
    for key in ("precision", "covariance", "left_open", "unknown", "recording"):
        matrix = getattr(normal, key)
        least = np.linalg.eigvalsh(matrix)[0]
        negative = least <= 0.0 if key == "precision" else least < -ROUNDED * np.max(np.abs(matrix))
        if not np.allclose(matrix, matrix.T) or negative:
            raise ValueError(f"'{key}' must be symmetric, without negative directions")
