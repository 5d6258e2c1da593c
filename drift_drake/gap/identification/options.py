"""What an identification can be asked for and may find, apart from how it is done."""

from typing import Literal

AskedKind = Literal["auto", "single-track", "double-track"]
Criterion = Literal["auto", "likelihood", "prediction"]
KNOWN = ("mass", "wheel_radius")  # scales and a tape measure know them better than any drive
EFFECTS = ("steering_lag", "torque_lag", "rolling_resistance", "aero_drag", "front_rear_friction_split")
LARGEST_SCALE = 1e4  # of noise and process: beyond, a number is an error of the file
