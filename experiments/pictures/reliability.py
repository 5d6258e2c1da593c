"""How often stated probabilities held on held-out logs of cars with other equations.

The probabilities are those of `2026-11-28_reliability.csv`, which `experiments.other_worlds.reliability` writes of the
run folders of `experiments.other_worlds.road`.
"""

from pathlib import Path

from matplotlib.figure import Figure

from experiments.other_worlds.reliability import draw_reliability, read_panels

STATED = Path(__file__).parents[1] / "results" / "2026-11-28_reliability.csv"


def draw() -> Figure:
    """The panels."""
    return draw_reliability(read_panels(STATED))
