"""The package measured as a whole: counts of its structure, and baselines that a redesign must keep."""
