"""Watching a car that was calibrated by prediction: the scores of its windows against its own null distribution."""
