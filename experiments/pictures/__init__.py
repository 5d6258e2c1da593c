"""Pictures of the documentation that explain; a module a picture, each drawn for a narrow screen."""

from typing import Literal

Name = Literal[
    "car_frames",
    "diagnosis",
    "drive_time_series",
    "effects_map",
    "gap",
    "layers",
    "loop",
    "predictions",
    "safe_stop",
    "two_criteria",
]
