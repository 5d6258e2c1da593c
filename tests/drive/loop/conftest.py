"""The course that faulted loops drive."""

import dataclasses

import pytest
from faulted_loops import PARAMETERS

from drift_drake.drive.reference.trajectory import Reference, figure_8


@pytest.fixture(scope="package")
def short() -> Reference:
    return dataclasses.replace(figure_8(PARAMETERS), distance=30.0)
