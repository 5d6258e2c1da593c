"""A trained model as one small .npz file that needs NumPy only."""

import dataclasses
import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drift_drake.errors import DriftDrakeError
from drift_drake.model.features import Network, input_scaling
from drift_drake.model.posterior import Posterior, block_diagonal, from_precision
from drift_drake.vehicle.parameters import VehicleParameters

Array = NDArray[np.float64]

FORMAT = 1
PRECISION_FLOOR = 1e-6  # added to the diagonal of Lambda_0 = L L^T, which may be singular while it trains
WEIGHTS = ("w1", "b1", "w2", "b2", "w_out", "b_out")


class InvalidCheckpointError(DriftDrakeError, ValueError):
    """A file that holds no model; the message names the file and the mend."""


@dataclasses.dataclass(frozen=True)
class BayesianModel:
    """Features, prior and noise of the learnt car, and where they come from."""

    network: Network
    prior_mean: Array  # [4, 16]
    precision_factor: Array  # L of Lambda_0 = L L^T + floor, [64, 64], full
    sigma: Array  # noise scale of each learnt state, [4]
    sample_weight: Array  # of one sample in the posterior, by state [4], see `posterior`; 1 is the paper's recursion
    vehicle: VehicleParameters  # the car inside h
    record: dict[str, Any]  # how it was trained: configuration, data hash, likelihoods
    # z [n, 10] of some drifting samples that it was trained on: where predictions are wanted of it.
    drifts: Array | None = None

    def prior(self) -> Posterior:
        """The belief before any data of the vehicle at hand."""
        factor = self.precision_factor
        precision = factor @ np.swapaxes(factor, -1, -2) + PRECISION_FLOOR * np.eye(factor.shape[-1])
        return from_precision(self.prior_mean, precision, self.sigma)

    def trainable_count(self) -> int:
        """Number of trainable parameters: network, prior mean and precision, noise scales (27,012 in the paper; its
        network's inputs are z alone, and its prior does not couple the states)."""
        weights = sum(np.size(getattr(self.network, name)) for name in WEIGHTS)
        return weights + self.prior_mean.size + int(np.count_nonzero(self.precision_factor)) + self.sigma.size

    def save(self, path: str | Path) -> None:
        """Writes the checkpoint. Weights trained in single precision are stored so; nothing is lost."""
        arrays: dict[str, Any] = {name: getattr(self.network, name).astype(np.float32) for name in WEIGHTS}
        if self.drifts is not None:
            arrays["drifts"] = self.drifts.astype(np.float32)
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        with Path(path).open("wb") as file:
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


def load(path: str | Path | None = None) -> BayesianModel:
    """Reads a checkpoint; without a path, the one shipped with the package.

    Raises:
        InvalidCheckpointError: names the file and the mend.
    """
    source = Path(str(files("drift_drake") / "data" / "bayesian_model.npz")) if path is None else Path(path)
    try:
        with np.load(source, allow_pickle=False) as stored:
            arrays = {name: np.asarray(stored[name]) for name in stored.files}
        about = json.loads(str(arrays.pop("about")))
        weights = {name: np.asarray(arrays[name], dtype=float) for name in ("input_offset", "input_scale", *WEIGHTS)}
        prior = {name: np.asarray(arrays[name], dtype=float) for name in ("prior_mean", "precision_factor", "sigma")}
        drifts = np.asarray(arrays["drifts"], dtype=float) if "drifts" in arrays else None  # not in those of old
        weight = np.full(prior["sigma"].shape, arrays["sample_weight"], dtype=float)  # one number for all, of old
        if prior["precision_factor"].ndim == 3:  # of states that know nothing of each other
            prior["precision_factor"] = block_diagonal(prior["precision_factor"])
    except FileNotFoundError:
        raise InvalidCheckpointError(f"{source}: no such file; train a model with `drift-drake train`") from None
    except (ValueError, KeyError, OSError, EOFError) as error:
        raise InvalidCheckpointError(f"{source}: not a model checkpoint ({error}); train it anew") from None
    if about.get("format") != FORMAT:
        raise InvalidCheckpointError(
            f"{source}: checkpoint format {about.get('format')!r}, this version reads {FORMAT}; train it anew"
        )
    vehicle = VehicleParameters.from_dict(about["vehicle"], f"{source} (vehicle)")
    count = len(weights["input_offset"])
    counts = [len(input_scaling(physical)[0]) for physical in (False, True)]
    if count not in counts:
        raise InvalidCheckpointError(
            f"{source}: its network has {count} inputs, this version's have {counts[0]} or {counts[1]}; train it anew"
        )
    physical = count == counts[1]
    network = Network(**weights, nominal=vehicle.constants() if physical else None)
    return BayesianModel(network, **prior, sample_weight=weight, vehicle=vehicle, record=about["record"], drifts=drifts)
