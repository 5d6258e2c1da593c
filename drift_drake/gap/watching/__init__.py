"""Logs watched, as they come or afterwards: what changed, since when, and why."""
