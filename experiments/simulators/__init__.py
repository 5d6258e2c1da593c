"""Simulators of the user's, each judged against itself with a hidden change."""
