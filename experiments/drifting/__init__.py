"""Drifts under the models to be compared: the figure-8 and the loops, and what is to blame where they go wrong."""
