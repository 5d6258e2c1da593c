"""A simulator of the user's as a car: a Python function, a Drake system or an FMU, described by a simulator file."""
