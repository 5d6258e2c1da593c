"""Motion in SI to what a simulator is asked in its own numbers, and its answer back."""

from collections.abc import Mapping

import numpy as np

from drift_drake.car.foreign.along import between
from drift_drake.car.foreign.rollouts import Job
from drift_drake.car.foreign.signals import LEAD_IN, in_channels
from drift_drake.car.foreign.simulator import Simulator, SimulatorConstants
from drift_drake.common.arrays import Array, Index

CHANNELS = ("r", "v", "beta", "omega_r", "psi")


def job_of(
    constants: SimulatorConstants, dt: float, start: Array, inputs: Mapping[str, Array], held: Array | None = None
) -> Job:
    """Roll-outs from measured motion.

    Args:
        dt: between rows [s]; start: r, v, beta, omega_r, psi [n, 5], SI; inputs: by quantity [n, rows], SI, those that
            the simulator does not have unused; held: motion [n, lead + 1, 5] that the lead-in follows.
    """
    s = constants.simulator
    return Job(
        s.key, s.kind, s.target, s.folder, s.set_state, s.batch, s.limit, dt, start_values(s, start),
        {} if held is None else start_values(s, held),
        {signal.name: signal.own(np.asarray(inputs[key])) for key, signal in s.inputs.items() if key in inputs},
        tuple(dict.fromkeys(signal.name for signal in s.outputs.values())), constants.by_name(),
    )  # fmt: skip


def job_along(
    constants: SimulatorConstants, period: float, motion: Array, signals: Mapping[str, Array], begin: Index, lead: int,
    rows: int,
) -> Job:  # fmt: skip
    """Roll-outs along a run.

    Args:
        period: between the run's rows [s]; motion: measured, [rows of the run, 5], SI; signals: inputs along it
            (`along.inputs_along`); begin: row that each begins at [n], `lead` rows of lead-in before what counts;
        rows: that they last, from there.
    """
    steps = constants.simulator.steps_in(period)
    at = np.arange(steps * rows + 1)
    grid = (steps * begin)[:, None] + at
    inputs = {name: values[grid] for name, values in signals.items() if name in constants.simulator.inputs}
    inputs[LEAD_IN] = np.broadcast_to(np.where(at < steps * lead, 1.0, 0.0), grid.shape)
    held = between(motion, begin[:, None] + at[: steps * lead + 1] / steps) if lead else None
    return job_of(constants, period / steps, motion[begin], inputs, held)


def start_values(simulator: Simulator, motion: Array) -> dict[str, Array]:
    """Start values by their names, of motion [..., 5]."""
    si = in_channels(motion)
    return {signal.name: signal.own(si[key]) for key, signal in simulator.start.items()}


def motion_of(simulator: Simulator, got: Mapping[str, Array], dt: float) -> Array:
    """Outputs in SI as r, v, beta, omega_r, psi [n, rows, 5]; NaN where the simulator does not say.

    The heading is the integral of the yaw rate where it is no output.
    """
    si = {key: signal.si(got[signal.name]) for key, signal in simulator.outputs.items()}
    if "v_x" in si and "v_y" in si:
        si.setdefault("v", np.hypot(si["v_x"], si["v_y"]))
        si.setdefault("beta", np.arctan2(si["v_y"], si["v_x"]))
    r = si["r"]
    turned = np.cumsum(0.5 * dt * (r[:, 1:] + r[:, :-1]), axis=1)
    psi = np.unwrap(si["psi"], axis=1) if "psi" in si else np.concatenate([np.zeros((len(r), 1)), turned], axis=1)
    return np.stack([np.broadcast_to(si.get(name, np.nan), r.shape) for name in CHANNELS[:4]] + [psi], axis=-1)
