"""The diagnosis of a car that follows the equations: hypotheses by the likelihood of a filter over whole runs."""
