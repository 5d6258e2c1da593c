"""Each claim, table and figure of the paper, with what came out here: `python -m experiments.paper`."""
