"""Real tyres stiffen with their load: what a heavier car, or one whose weight has moved, does to axle stiffnesses.

The catalogue's `mass_error` and `cg_shift` leave the stiffnesses as they are, as the nominal simulator does. On a car
with real tyres an axle's stiffness follows its load, which is another signature of the same cause. Shares of it
are tried.
"""

from drift_drake.vehicle.parameters import Constants

FOLLOWING = ("mass_error", "cg_shift")  # effects that move axle loads
SHARES = (0.0, 0.5, 1.0)  # of proportional stiffness that are tried


def with_load(name: str, magnitude: float, share: float, constants: Constants) -> dict[str, float]:
    """Effects of a magnitude whose axle stiffnesses follow a share of what the static loads change by.

    Args:
        constants: of the calibrated car, `cg_shift`'s axle distances.
    """
    if name == "mass_error":
        return {name: magnitude, "front_stiffness_error": share * magnitude, "rear_stiffness_error": share * magnitude}
    if name == "cg_shift":
        return {
            name: magnitude,
            "front_stiffness_error": -share * magnitude / float(constants.rear_axle_distance),
            "rear_stiffness_error": share * magnitude / float(constants.front_axle_distance),
        }
    return {name: magnitude}
