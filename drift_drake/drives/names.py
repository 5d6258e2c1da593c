"""Names of the manoeuvres."""

from typing import Literal, get_args

Name = Literal["straight", "step_steer", "slalom", "figure_8", "loops"]
NAMES: tuple[Name, ...] = get_args(Name)
