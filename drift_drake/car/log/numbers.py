"""Texts and other objects of a table's column as numbers."""

from typing import Any

import numpy as np
import pandas as pd

from drift_drake.common.arrays import Array

ENDLESS = r"\s*[+-]?\d{300,}\s*"  # an integer that is beyond all floats
MEASURABLE = 1e30  # beyond it nothing is measured, and squares of sums overflow


def as_numbers(values: "pd.Series[Any]") -> "pd.Series[Any]":
    """A column's numbers, NaN where it holds none."""
    try:
        return pd.to_numeric(values, errors="coerce")
    except OverflowError:
        return pd.to_numeric(values.mask(values.astype(str).str.fullmatch(ENDLESS)), errors="coerce")


def measured_numbers(values: "pd.Series[Any]") -> Array:
    """A column of numbers [n], NaN where they are none that could be measured, or a damaged file's signalling NaN."""
    with np.errstate(invalid="ignore"):
        return without_endless(values.to_numpy(dtype=float, na_value=np.nan))


def without_endless(values: Array) -> Array:
    """Numbers [n], NaN where they are none that could be measured."""
    endless = ~(np.abs(values) <= MEASURABLE)
    return np.where(endless, np.nan, values) if endless.any() else values
