"""Experiments, `python -m experiments.FOLDER.NAME`; results go to runs/."""

import diagrams  # noqa: F401 (answers Ctrl-C, and sets the number of BLAS threads before NumPy is imported)
