"""Samples (x_k, u_k, u_{k+1}, x_{k+1}) at 10 Hz: what the model is trained on, adapts to and is judged by."""

import hashlib
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from drift_drake.car.single_track.motion import INPUTS, STATES
from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError, one_line
from drift_drake.common.plain_files import check_file
from drift_drake.common.safe_files import replacing
from drift_drake.drive.learnt.command_lag import LAG, lagged_commands

Indices = NDArray[np.int64]

PHASE_STRIDE = 1000  # between the vehicle numbers of two phases of the same drives
DRIFTING = 0.2  # [rad] of sideslip from which on a sample counts as drifting
MIRROR_INPUT = np.array([-1.0, 1.0])  # (delta, tau) seen in a mirror
MIRROR_STATE = np.concatenate([[-1.0, 1.0, -1.0, 1.0, -1.0, -1.0], MIRROR_INPUT])
WIDTHS = {"x": MIRROR_STATE.shape, "x_next": MIRROR_STATE.shape, "u": MIRROR_INPUT.shape, "u_next": MIRROR_INPUT.shape}
DECIMATION = 10  # rows of a log to a sample


class InvalidSamplesError(DriftDrakeError, ValueError):
    """A table that cannot be used; the message names the file, the place and the remedy."""


class Samples(NamedTuple):
    """n samples; those of one drive are consecutive in time and stand together."""

    x: Array  # measured (r, v, beta, omega_r, e, dphi) and lagged commands at the start of the step [n, 8]
    u: Array  # commands (delta, tau) then [n, 2]
    u_next: Array  # commands at the end of the step [n, 2]
    x_next: Array  # the same at the end of the step [n, 8]
    curvature: Array  # of the path, mean over the step [n] [1/m]
    vehicle: Indices  # which vehicle [n]
    drive: Indices  # which drive [n]

    def of_vehicle(self, vehicle: int) -> "Samples":
        return self.where(self.vehicle == vehicle)

    def where(self, chosen: NDArray[np.bool_] | Indices) -> "Samples":
        """The samples that a mask or an index array picks."""
        columns: list[Any] = [column[chosen] for column in self]
        return Samples(*columns)

    def drives(self) -> list["Samples"]:
        """One table a drive, in order."""
        if not len(self.drive):
            return []
        cuts = np.flatnonzero(np.diff(self.drive)) + 1
        return [Samples(*columns) for columns in zip(*(np.split(column, cuts) for column in self), strict=True)]


def concatenate(parts: list[Samples]) -> Samples:
    """Several tables in one."""
    return Samples(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def mirrored(samples: Samples) -> Samples:
    """The same drives turning the other way, numbered as further drives and vehicles (the paper doubles its set so)."""
    return Samples(
        samples.x * MIRROR_STATE,
        samples.u * MIRROR_INPUT,
        samples.u_next * MIRROR_INPUT,
        samples.x_next * MIRROR_STATE,
        -samples.curvature,
        samples.vehicle + samples.vehicle.max(initial=-1) + 1,
        samples.drive + samples.drive.max(initial=-1) + 1,
    )


def content_hash(samples: Samples) -> str:
    """SHA-256 of the numbers: which data a model was trained on."""
    digest = hashlib.sha256()
    for name, column in zip(Samples._fields, samples, strict=True):
        digest.update(f"{name}{column.shape}{column.dtype}".encode())
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def save_samples(samples: Samples, path: str | Path) -> None:
    """Writes a table as .npz."""
    with replacing(path) as part, part.open("wb") as file:
        np.savez_compressed(file, **samples._asdict())


def _numbers(column: NDArray[Any]) -> NDArray[Any]:
    if column.dtype.kind not in "fiu":
        raise ValueError(f"a column of {column.dtype}")
    return column


def load_samples(path: str | Path) -> Samples:
    """Reads a table written by `save_samples`.

    Raises:
        InvalidSamplesError: names the file, the column and the remedy.
    """
    try:
        if Path(path).exists():
            check_file(path, InvalidSamplesError, "give a table of samples")
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as stored:
            missing = [name for name in Samples._fields if name not in stored.files]
            if missing:
                raise InvalidSamplesError(
                    f"{path}: no column {', '.join(missing)}; make it with `experiments.model.drives`"
                )
            samples = Samples(*(_numbers(stored[name]) for name in Samples._fields))
    except FileNotFoundError:
        raise InvalidSamplesError(
            f"{path}: no such file; make it with `python -m experiments.model.drives`, "
            "or `python -m experiments.gathering.lane_drives` for a table of lane drives"
        ) from None
    except InvalidSamplesError:
        raise
    except Exception as error:  # zip, zlib, NumPy and its header's parser raise a dozen kinds on a damaged file
        raise InvalidSamplesError(f"{path}: not a table of samples ({one_line(error)}); make it anew") from None
    for name, column in zip(Samples._fields, samples, strict=True):
        wanted = (*np.shape(samples.drive), *WIDTHS.get(name, ()))
        if column.shape != wanted:
            raise InvalidSamplesError(
                f"{path}: {name} has the shape {column.shape}, not {wanted} (a row a sample; in x and x_next the six "
                "states and the lagged commands); make it anew"
            )
    if len(samples.x) == 0:
        raise InvalidSamplesError(f"{path}: holds no sample; make it anew from drives of 0.2 s or more")
    for name, column in zip(Samples._fields, samples, strict=True):
        bad = np.flatnonzero(~np.isfinite(column.reshape(len(column), -1)).all(axis=1))
        if len(bad):
            raise InvalidSamplesError(f"{path}: {name} is not finite in row {bad[0]}; drop that row or correct it")
    return samples


class CurvatureLookup(Protocol):
    """What is asked of a path here; see `drift_drake.drive.reference.path.Path`."""

    def curvature(self, s: Array) -> Array:
        """Curvature [1/m] at s [m]."""


def samples_from_log(
    table: pd.DataFrame, path: CurvatureLookup | None, vehicle: int, drive: int, phase: int = 0, lag: Array = LAG
) -> Samples:
    """Every tenth row of a log, from row `phase` on, as samples.

    Args:
        table: rows 0.01 s apart with t, the six measured states, s, delta_cmd and tau_cmd.
        path: that e, dphi and s refer to; None for a straight one (of no curvature).
        lag: of steering and torque [s], which the lagged commands are behind.

    Examples:
        >>> samples_from_log(table, None, vehicle=0, drive=0).u.shape
        (40, 2)
    """
    commands = table[[f"{name}_cmd" for name in INPUTS]].to_numpy()
    lagged = lagged_commands(table["t"].to_numpy(), commands, lag)
    states = np.concatenate([table[list(STATES)].to_numpy(), lagged], axis=1)
    states, commands = states[phase::DECIMATION], commands[phase::DECIMATION]
    count = max(0, len(states) - 1)
    if path is None:
        curvature = np.zeros(count)
    else:
        fine = np.asarray(path.curvature(table["s"].to_numpy()))
        # The mean over a step: trapezoidal over the rows between its ends.
        middle = 0.5 * (fine[1:] + fine[:-1])
        curvature = np.array([middle[phase + DECIMATION * k :][:DECIMATION].mean() for k in range(count)])
    return Samples(states[:-1], commands[:-1], commands[1:], states[1:], curvature, np.full(count, vehicle),
                   np.full(count, drive))  # fmt: skip
