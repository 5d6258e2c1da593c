"""Calibrating a nominal car on its logs: parameters with intervals, and what the logs cannot tell.

`identify.identify` is the way in; `drift-drake identify` its command. It maximises the likelihood of the diagnosis's
filter, with the vehicle's own parameters as unknowns under broad priors in place of tolerances.
"""
