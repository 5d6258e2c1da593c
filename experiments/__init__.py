"""Experiments: one file each, `python -m experiments.NAME`; results go to runs/."""

import diagrams  # noqa: F401 (sets the number of BLAS threads before NumPy is imported)
