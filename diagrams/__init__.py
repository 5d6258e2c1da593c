"""Diagrams: each file builds one, runs it and can draw its graph (`python -m diagrams.closed_loop --graph`)."""

import os

from diagrams import command  # noqa: F401 (first of all: it answers Ctrl-C from here on)

# Matrices of a horizon are small: one thread of BLAS is faster than several, many times so when other work runs.
# This has an effect because Python imports this package before NumPy when it runs one of its modules.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
