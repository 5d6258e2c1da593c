"""The shipped model, whose plans these tests make."""

import pytest

from drift_drake.model.checkpoint import BayesianModel, load_model


@pytest.fixture(scope="session")
def model() -> BayesianModel:
    return load_model()
