"""Pictures of the documentation that explain; a module a picture, each made for a narrow screen."""

from typing import Literal

Name = Literal[
    "car_frames",
    "demo",
    "diagnosis",
    "drive_time_series",
    "effects_map",
    "figure_8",
    "framework",
    "gap",
    "layers",
    "loop",
    "predictions",
    "reliability",
    "replay",
    "report",
    "safe_stop",
    "still",
    "two_criteria",
]
