"""What is normal for a calibrated car, and its place in a calibration's file."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from drift_drake.errors import shown
from drift_drake.estimation.windows import HORIZONS, PREDICTED, STRIDE
from drift_drake.plain_files import number
from drift_drake.vehicle.catalogue import CATALOGUE

WORST = 9.0  # mean squares, in robust scales, at which a window's error is capped
LOST = 1e4  # the same of what is shown and located: a prediction a hundred normal errors off
LARGEST_NUMBER = 1e100  # of a calibration's file: beyond, its squares are not finite
ROUNDED = 1e-6  # of a matrix's largest entry, by which rounding may make an eigenvalue negative


def capped_squares(e: np.ndarray, cap: float = WORST) -> np.ndarray:
    """Squares of errors in scales, capped: a prediction that far off is lost, however far."""
    return np.asarray(np.minimum(e**2, cap))


@dataclasses.dataclass(frozen=True)
class Normal:
    """What is normal for a calibrated car. Scores are in `units` of the effects `names`."""

    names: tuple[str, ...]
    stride: float  # [s] between horizons
    units: np.ndarray  # [n]
    scales: np.ndarray  # [HORIZONS, channels]
    precision: np.ndarray  # of errors in scales [HORIZONS * channels, the same]
    blocks: int
    mean: np.ndarray  # score of a block [n]
    covariance: np.ndarray  # from block to block [n, n]
    modes: np.ndarray  # score of a block, run by run [runs, n]: another day mixes manoeuvres in other shares
    information: np.ndarray  # diagonal of a block's information [n]
    covered: np.ndarray  # how hard the car was driven [4] (`windows.regimes`)
    unknown: np.ndarray  # covariance of what calibration left unknown, in units [n, n]
    recording: np.ndarray  # covariance of the effects from one recording to the next, in units [n, n]
    offset: np.ndarray  # median errors [HORIZONS, channels]
    level: np.ndarray  # mean squared errors about them, in scales and capped [HORIZONS, channels]

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
    names = tuple(str(name) for name in arrays.pop("names"))  # type: ignore[attr-defined]
    blocks = int(number(arrays.pop("blocks"), lambda count: count >= 1.0 and count == round(count)))
    stride = number(arrays.pop("stride"), lambda seconds: 0.0 < seconds <= STRIDE)
    try:
        out = Normal(
            names, stride, blocks=blocks, **{key: np.array(value, dtype=float) for key, value in arrays.items()}
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
    shapes: dict[str, tuple[int, ...]] = {"covered": (4,), "precision": (m, m), "scales": (HORIZONS, len(PREDICTED))}
    shapes |= dict.fromkeys(("units", "mean", "information"), (n,))
    shapes |= dict.fromkeys(("covariance", "unknown", "recording"), (n, n))
    shapes |= dict.fromkeys(("offset", "level"), shapes["scales"])
    shapes["modes"] = (max(len(np.atleast_1d(normal.modes)), 1), n)
    for key, shape in shapes.items():
        if getattr(normal, key).shape != shape or not np.all(np.abs(getattr(normal, key)) < LARGEST_NUMBER):
            raise ValueError(f"'{key}' must hold {shape} finite numbers")
    for key in ("units", "scales"):
        if np.min(getattr(normal, key)) <= 0.0:
            raise ValueError(f"'{key}' must be above zero")
    for key in ("information", "covered", "level"):
        if np.min(getattr(normal, key)) < 0.0:
            raise ValueError(f"'{key}' must be zero or more")
    for key in ("precision", "covariance", "unknown", "recording"):
        matrix = getattr(normal, key)
        least = np.linalg.eigvalsh(matrix)[0]
        negative = least <= 0.0 if key == "precision" else least < -ROUNDED * np.max(np.abs(matrix))
        if not np.allclose(matrix, matrix.T) or negative:
            raise ValueError(f"'{key}' must be symmetric, without negative directions")
