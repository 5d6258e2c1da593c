"""A trained model as one small .npz file that needs NumPy only."""

import dataclasses
import hashlib
import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.vehicle_file import check_plausible
from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError, one_line, shown
from drift_drake.common.plain_files import check_archive, check_file, parse_json
from drift_drake.common.safe_files import replacing
from drift_drake.drive.learnt.command_lag import LAG
from drift_drake.drive.learnt.features import (
    FEATURE_COUNT,
    HIDDEN_COUNT,
    INPUT_COUNT,
    MEAN_COUNT,
    STATE_COUNT,
    Network,
    input_scaling,
)
from drift_drake.drive.learnt.posterior import Posterior, block_diagonal, from_precision

FORMAT = 1
PRECISION_FLOOR = 1e-6  # added to the diagonal of Lambda_0 = L L^T, which may be singular while it trains
LARGEST = 64 * 1024 * 1024  # bytes of a file; today's have 150,000
LARGEST_NUMBER = 1e12
WEIGHTS = ("w1", "b1", "w2", "b2", "w_out", "b_out")
ARRAYS = ("input_offset", "input_scale", *WEIGHTS, "prior_mean", "precision_factor", "sigma", "sample_weight")


class InvalidCheckpointError(DriftDrakeError, ValueError):
    """A file that holds no model; the message names the file and the remedy."""


@dataclasses.dataclass(frozen=True)
class BayesianModel:
    """Features, prior and noise of the learnt car (section II of the paper), and where they come from.

    Examples:
        >>> model.prior().mean.shape, model.sigma.shape
        ((4, 16), (4,))
    """

    network: Network  # makes the features phi [..., 4, 16] of z
    prior_mean: Array  # [4, 16]
    precision_factor: Array  # L of Lambda_0 = L L^T + floor, [64, 64], full
    sigma: Array  # noise scale of each learnt state, [4]
    sample_weight: Array  # of one sample in the posterior, by state [4], see `posterior`; 1 is the paper's recursion
    vehicle: VehicleParameters  # the car inside h
    record: dict[str, Any]  # how it was trained: configuration, data hash, likelihoods
    drifts: Array | None = None  # z [n, 10] of drifting samples of its training: where predictions are wanted of it

    @property
    def lag(self) -> Array:
        """Lags [2] of steering and torque of the car at hand [s]."""
        return np.array(self.network.lag)

    def with_lag(self, lag: Array) -> "BayesianModel":
        """The model of a car with another lag [2] of steering and torque [s] (`command_lag`)."""
        network, drifts = self.network._replace(lag=(float(lag[0]), float(lag[1]))), self.drifts
        if drifts is not None:
            drifts = self.network.as_typical(drifts)
            if network.typical is not None:
                drifts = np.asarray(np.linalg.solve(network.typical, drifts.T).T, dtype=float)
        return dataclasses.replace(self, network=network, drifts=drifts)

    def prior(self) -> Posterior:
        """The belief before any data of the vehicle at hand."""
        factor = self.precision_factor
        precision = factor @ np.swapaxes(factor, -1, -2) + PRECISION_FLOOR * np.eye(factor.shape[-1])
        return from_precision(self.prior_mean, precision, self.sigma)

    def content_hash(self) -> str:
        """SHA-256 of the model's numbers; the lags of the car at hand are none of them."""
        digest, network = hashlib.sha256(), self.network
        if network.nominal is not None and self.vehicle.tyre == "brush":  # the tyre that is not said
            numbers: Any = network.nominal[: Constants._fields.index("tyre")]
            network = network._replace(nominal=numbers)
        trained = network[: Network._fields.index("lag")]
        for values in (*trained, self.prior_mean, self.precision_factor, self.sigma, self.sample_weight):
            digest.update(np.ascontiguousarray(values, dtype=float).tobytes())
        return digest.hexdigest()

    def save(self, path: str | Path) -> None:
        """Writes the checkpoint. Weights trained in single precision are stored so; nothing but the lags is lost.

        Raises:
            OutputError: it cannot be written.
        """
        arrays: dict[str, Any] = {name: getattr(self.network, name).astype(np.float32) for name in WEIGHTS}
        drifts = self.with_lag(LAG).drifts
        if drifts is not None:
            arrays["drifts"] = drifts.astype(np.float32)
        with replacing(path) as part, part.open("wb") as file:
            np.savez_compressed(
                file,
                **arrays,
                input_offset=self.network.input_offset,
                input_scale=self.network.input_scale,
                prior_mean=self.prior_mean,
                precision_factor=self.precision_factor,
                sigma=self.sigma,
                sample_weight=self.sample_weight,
                about=json.dumps({"format": FORMAT, "vehicle": self.vehicle.to_dict(), "record": self.record}),
            )


def shipped(name: str) -> Path:
    """A file that ships with the package."""
    return Path(str(files("drift_drake") / "data" / name))


def paper_checkpoint() -> Path:
    """The shipped model of the paper's recipe: 27,012 parameters, z alone, T = 10, four beliefs, 35 vehicles."""
    return shipped("bayesian_model_paper.npz")


def load_varied() -> BayesianModel:
    """The shipped model whose prior is of cars of many structures (`experiments.model.varied`)."""
    return load_model(shipped("varied_model.npz"))


def load_model(path: str | Path | None = None) -> BayesianModel:
    """Reads a checkpoint; without a path, the one shipped with the package.

    Raises:
        InvalidCheckpointError: names the file and the remedy; InvalidVehicleError: of the vehicle in it.

    Examples:
        >>> belief = load_model().prior()
    """
    source = shipped("bayesian_model.npz") if path is None else Path(path)
    arrays, about = _stored(source)
    if about.get("format") != FORMAT:
        raise InvalidCheckpointError(
            f"{source}: checkpoint format {shown(about.get('format'))}, this version reads {FORMAT}; train it anew"
        )
    vehicle = VehicleParameters.from_dict(about["vehicle"], f"{source} (vehicle)")
    check_plausible(vehicle, f"{source} (vehicle)")
    count = len(np.atleast_1d(arrays["input_offset"]))
    counts = [len(input_scaling(physical)[0]) for physical in (False, True)]
    if count not in counts:
        raise InvalidCheckpointError(
            f"{source}: its network has {count} inputs, this version's have {counts[0]} or {counts[1]}; train it anew"
        )
    _check_arrays(source, arrays, count)
    physical = count == counts[1]
    weights: dict[str, Any] = {name: arrays[name] for name in ("input_offset", "input_scale", *WEIGHTS)}
    prior = {name: arrays[name] for name in ("prior_mean", "precision_factor", "sigma", "sample_weight")}
    network = Network(**weights, nominal=vehicle.constants() if physical else None)
    return BayesianModel(network, **prior, vehicle=vehicle, record=about["record"], drifts=arrays.get("drifts"))


def _stored(source: Path) -> tuple[dict[str, Array], dict[str, Any]]:
    """The arrays of a file and what it says about itself, in today's form."""
    remedy = "train it anew"
    try:
        if not source.exists():
            raise InvalidCheckpointError(f"{source}: no such file; train a model with `drift-drake train`")
        check_file(source, InvalidCheckpointError, remedy, LARGEST)
        check_archive(source, InvalidCheckpointError, remedy, LARGEST)
        with source.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            names = [name for name in (*ARRAYS, "drifts") if name in stored.files or name in ARRAYS]
            arrays = {name: np.asarray(stored[name], dtype=float) for name in names}
            about = parse_json(str(stored["about"]), InvalidCheckpointError, str(source), remedy, strict=False)
        arrays["sample_weight"] = np.full(arrays["sigma"].shape, arrays["sample_weight"])  # one number for all, of old
        if arrays["precision_factor"].ndim == 3:  # of states that know nothing of each other
            arrays["precision_factor"] = block_diagonal(arrays["precision_factor"])
        if not isinstance(about["vehicle"], dict) or not isinstance(about["record"], dict):
            raise ValueError("it does not say how it was made")
    except InvalidCheckpointError:
        raise
    except Exception as error:  # zip, zlib, NumPy and its header's parser raise a dozen kinds on a damaged file
        raise InvalidCheckpointError(f"{source}: not a model checkpoint ({one_line(error)}); {remedy}") from None
    return arrays, about


def _check_arrays(source: Path, arrays: dict[str, Array], inputs: int) -> None:
    shapes = {
        "input_offset": (inputs,), "input_scale": (inputs,), "w1": (inputs, HIDDEN_COUNT), "b1": (HIDDEN_COUNT,),
        "w2": (HIDDEN_COUNT, HIDDEN_COUNT), "b2": (HIDDEN_COUNT,),
        "w_out": (STATE_COUNT, HIDDEN_COUNT, FEATURE_COUNT), "b_out": (STATE_COUNT, FEATURE_COUNT),
        "prior_mean": (STATE_COUNT, FEATURE_COUNT), "precision_factor": (MEAN_COUNT, MEAN_COUNT),
        "sigma": (STATE_COUNT,), "sample_weight": (STATE_COUNT,),
    }  # fmt: skip
    if "drifts" in arrays:
        shapes["drifts"] = (*arrays["drifts"].shape[:1], INPUT_COUNT)
    for name, shape in shapes.items():
        array = arrays[name]
        if array.shape != shape:
            raise InvalidCheckpointError(f"{source}: {name} has the shape {array.shape}, not {shape}; train it anew")
        if not (np.abs(array) < LARGEST_NUMBER).all():
            raise InvalidCheckpointError(f"{source}: {name} holds numbers that are not finite or huge; train it anew")
    for name, high in (("input_scale", np.inf), ("sigma", np.inf), ("sample_weight", 1.0)):
        if not ((arrays[name] > 0.0) & (arrays[name] <= high)).all():
            limit = "above 0" if high == np.inf else f"above 0, up to {high:g}"
            raise InvalidCheckpointError(f"{source}: {name} must be {limit}; train it anew")
