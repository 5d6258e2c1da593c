"""Logs of real vehicles."""
