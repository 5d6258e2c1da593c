"""Simulated drives: the car, the loop around it, its logs, and faults between its parts."""
