"""The network in PyTorch: its numbers, and the device that it is trained on."""

import dataclasses

import numpy as np
import pytest

from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.learnt.features import (
    STATE_COUNT,
)
from drift_drake.drive.learnt.training_config import TrainingConfig

torch = pytest.importorskip("torch", reason="training needs the extra `train`")

from drift_drake.drive.learnt.meta_training import train  # noqa: E402
from drift_drake.drive.learnt.torch_network import (  # noqa: E402
    initial_parameters,
    trainable_numbers,
    training_device,
)


def test_parameters_number_as_in_the_paper() -> None:
    coupling = 64 * 64 - 4 * 16 * 16
    for physical, coupled, count in (
        (False, False, 27_012),
        (True, False, 27_012 + 10 * 128),
        (True, True, 27_012 + 10 * 128 + coupling),
    ):
        parameters = initial_parameters(torch.Generator().manual_seed(0), physical, coupled)
        assert sum(value.numel() for value in parameters.values()) == count


def test_a_weight_of_one_is_gone_on_from(config: TrainingConfig) -> None:
    model = train(dataclasses.replace(config, epochs=0))
    weights = np.array([0.2, 1.0, 0.5, 0.1])
    scale = torch.ones(STATE_COUNT, dtype=torch.float64)
    logit = trainable_numbers(dataclasses.replace(model, sample_weight=weights), scale)["logit_weight"]
    np.testing.assert_allclose(torch.sigmoid(logit).detach().numpy(), weights, atol=1e-5)


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU here")
def test_without_a_gpu_auto_is_the_cpu_and_cuda_is_refused(config: TrainingConfig) -> None:
    assert training_device("auto").type == training_device("cpu").type == "cpu"
    with pytest.raises(InvalidOptionError, match="--device cuda: torch finds no GPU here; choose cpu, or auto"):
        train(dataclasses.replace(config, device="cuda"))


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU here")
def test_a_gpu_computes_the_same_objective(config: TrainingConfig) -> None:
    losses = {}
    for device in ("cpu", "cuda"):
        output = config.output.with_name(f"{device}.npz")
        losses[device] = train(dataclasses.replace(config, epochs=3, device=device, output=output)).record["history"]
    assert losses["cuda"][-1]["loss"] == pytest.approx(losses["cpu"][-1]["loss"], abs=1e-2)
