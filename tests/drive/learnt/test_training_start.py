"""A training begins where another ended or was broken off."""

import dataclasses

import numpy as np
import pytest

from drift_drake.drive.learnt.checkpoint import InvalidCheckpointError, load_model
from drift_drake.drive.learnt.posterior import block_diagonal, state_blocks
from drift_drake.drive.learnt.training_config import TrainingConfig

torch = pytest.importorskip("torch", reason="training needs the extra `train`")

from drift_drake.drive.learnt import meta_training  # noqa: E402 (needs torch)
from drift_drake.drive.learnt.meta_training import train  # noqa: E402
from drift_drake.drive.learnt.window_objective import WindowObjective  # noqa: E402


def test_a_broken_off_run_goes_on_to_the_same_model(config: TrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = train(dataclasses.replace(config, output=config.output.with_name("whole.npz")))
    broken = dataclasses.replace(config, output=config.output.with_name("broken.npz"))
    calls = iter(range(10_000))
    step = WindowObjective._loss

    def interrupted(*arguments):
        if next(calls) == 120:
            raise KeyboardInterrupt
        return step(*arguments)

    monkeypatch.setattr(WindowObjective, "_loss", interrupted)
    monkeypatch.setattr(meta_training, "SAVE_EVERY", 5)
    with pytest.raises(KeyboardInterrupt):
        train(broken)
    monkeypatch.setattr(WindowObjective, "_loss", step)
    assert broken.output.with_name("broken.npz.resume").exists()
    resumed = train(broken)
    np.testing.assert_array_equal(resumed.network.w2, whole.network.w2)
    np.testing.assert_array_equal(resumed.precision_factor, whole.precision_factor)


def test_training_goes_on_from_a_checkpoint(config: TrainingConfig) -> None:
    first = train(dataclasses.replace(config, epochs=4))
    again = dataclasses.replace(config, start=config.output, output=config.output.with_name("again.npz"), epochs=0)
    unchanged = train(again)  # no epoch: the numbers there and back
    for name in ("w1", "b2", "w_out"):
        np.testing.assert_array_equal(
            getattr(unchanged.network, name), getattr(load_model(config.output).network, name)
        )
    for name in ("prior_mean", "precision_factor", "sigma"):
        np.testing.assert_allclose(getattr(unchanged, name), getattr(first, name), rtol=1e-12, atol=1e-15)
    further = train(dataclasses.replace(again, epochs=4))
    assert np.abs(further.network.w1 - first.network.w1).max() > 1e-4
    assert further.record["start"]["epochs"] == 4
    with pytest.raises(InvalidCheckpointError, match=r"model\.npz: its network has 18 inputs, .* for 8"):
        train(dataclasses.replace(again, physical_inputs=False))
    other = config.output.with_name("other.npz")
    dataclasses.replace(first, vehicle=first.vehicle.replace(mass=1.1 * first.vehicle.mass)).save(other)
    with pytest.raises(InvalidCheckpointError, match=r"other\.npz: its nominal car is not the one .* as --vehicle"):
        train(dataclasses.replace(again, start=other))


def test_windows_do_not_start_from_a_prior_that_couples_the_states(
    config: TrainingConfig, transfer: TrainingConfig
) -> None:
    coupled = train(dataclasses.replace(transfer, epochs=1, output=transfer.output.with_name("coupled.npz")))
    begun = dataclasses.replace(
        config, start=transfer.output.with_name("coupled.npz"), epochs=0, output=config.output.with_name("begun.npz")
    )
    message = r"coupled\.npz: its prior couples the states; windows start from one that does not"
    with pytest.raises(InvalidCheckpointError, match=message):
        train(begun)
    # Without its coupling it is taken, and its samples count as windows find.
    apart = block_diagonal(state_blocks(coupled.precision_factor))
    dataclasses.replace(coupled, precision_factor=apart).save(begun.output.with_name("apart.npz"))
    taken = train(dataclasses.replace(begun, start=begun.output.with_name("apart.npz")))
    np.testing.assert_array_equal(taken.precision_factor, apart)
    np.testing.assert_array_equal(taken.sample_weight, np.ones(4))


def test_tasks_couple_a_prior_that_windows_have_trained(config: TrainingConfig, transfer: TrainingConfig) -> None:
    first = train(dataclasses.replace(config, epochs=2, output=config.output.with_name("windows.npz")))
    begun = dataclasses.replace(
        transfer, start=config.output.with_name("windows.npz"), output=config.output.with_name("tasks.npz"), epochs=0
    )
    taken = train(begun)
    np.testing.assert_allclose(taken.precision_factor, first.precision_factor, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(taken.sample_weight, meta_training.FIRST_WEIGHT)
    further = train(dataclasses.replace(begun, epochs=2))
    assert np.abs(further.precision_factor - block_diagonal(state_blocks(further.precision_factor))).max() > 1e-4


def test_windows_may_couple_the_states(config: TrainingConfig) -> None:
    coupled = dataclasses.replace(config, coupled=True, output=config.output.with_name("together.npz"))
    model = train(coupled)
    assert np.abs(model.precision_factor - block_diagonal(state_blocks(model.precision_factor))).max() > 1e-4
    first, last = model.record["history"][0], model.record["history"][-1]
    assert last["validation_10"] < first["validation_10"]
    begun = dataclasses.replace(coupled, start=coupled.output, output=config.output.with_name("on.npz"), epochs=0)
    np.testing.assert_allclose(train(begun).precision_factor, model.precision_factor, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("kind", ["config", "transfer"])
def test_without_tyres_the_network_knows_lagged_commands_and_the_papers_inputs(
    kind: str, request: pytest.FixtureRequest
) -> None:
    config = request.getfixturevalue(kind)
    model = train(dataclasses.replace(config, tyres=False, epochs=3, output=config.output.with_name("memory.npz")))
    weights = load_model(config.output.with_name("memory.npz")).network.w1
    np.testing.assert_array_equal(model.network.w1, weights)
    np.testing.assert_array_equal(weights[10:], 0.0)
    assert np.abs(weights[8:10]).min() > 0.0
