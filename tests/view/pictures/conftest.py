"""A short run that is on the reference to the letter."""

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.reference.trajectory import Reference, figure_8


@pytest.fixture(scope="session")
def eight() -> Reference:
    return figure_8(VehicleParameters())


@pytest.fixture(scope="session")
def perfect_run(eight: Reference) -> pd.DataFrame:
    t = np.arange(0.0, 8.0, 0.02)
    s = eight.position(t)
    x, y, heading = eight.path.pose(s)
    r, v, beta, omega_r, e, dphi = eight.state(s).T
    delta, tau = eight.input(s).T
    return pd.DataFrame({
        "t": t, "x": x, "y": y, "psi": heading - beta, "r": r, "v": v, "beta": beta, "omega_r": omega_r, "e": e,
        "dphi": dphi, "s": s, "delta": delta, "tau": tau})  # fmt: skip
