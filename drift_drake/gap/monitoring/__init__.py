"""Watching the gap while driving: which effect the simulator lacks, since when, by how much."""
