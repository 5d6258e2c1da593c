"""Adapt the learnt model to a car's log, and see how much better it then predicts another of its logs."""

import numpy as np
import pandas as pd

from drift_drake import BayesianModel, Posterior, Run, learn, load_model, read_run, samples_from_log
from drift_drake.cli.demo import SAMPLE_LOG
from drift_drake.drive.learnt.quality import standardized_errors
from drift_drake.drive.learnt.samples import Samples


def samples_of(run: Run) -> Samples:
    """Steps of 0.1 s; the position relative to a path does not matter here."""
    columns = {name: run.column(name) for name in ("t", "r", "v", "beta", "omega_r", "delta_cmd", "tau_cmd")}
    return samples_from_log(pd.DataFrame(columns).assign(e=0.0, dphi=0.0, s=0.0), None, 0, 0)


def rms(model: BayesianModel, belief: Posterior, samples: Samples) -> np.ndarray:
    """One-step errors of (r, v, beta, omega_r) [4]."""
    return np.asarray(np.sqrt(np.mean(standardized_errors(model, belief, samples)[0] ** 2, axis=0)))


def main() -> tuple[np.ndarray, np.ndarray]:
    """Errors before and after adaptation."""
    model = load_model()
    first, second = (samples_of(read_run(str(SAMPLE_LOG / f"run_{i}.csv.gz"))) for i in (0, 1))
    before, after = rms(model, model.prior(), second), rms(model, learn(model, model.prior(), first), second)
    print(f"RMS error of (r, v, beta, omega_r): {before} before, {after} after {len(first.x)} steps of another run")
    return before, after


if __name__ == "__main__":
    main()
