"""Manoeuvres that show effects, in words: what to drive where logs cannot tell."""

SWEEPS = "steps and fast sine sweeps of the steering (up to 2 Hz) at constant speed, well within grip"
CIRCLES = "steady circles to the left and to the right at several speeds, slowly tightened until the car slides"
THROTTLE = "full throttle, part throttle and lift-off, in steps, straight on and in a turn"
FULL_THROTTLE = "full throttle straight on, from walking pace to top speed"
COASTING = "coasting straight on from top speed to walking pace, there and back on the same road"
STANDING = "standing still, then straight on for some seconds, heading logged"
FULL_CIRCLES = "full circles to the left and to the right, heading logged"
BOTH_WAYS = "straight on in both directions on the same road"
DRIFTS = "long drifts with the rear wheels spinning, from cold tyres to hot ones"
SPINNING = "full throttle straight on until the driven wheels spin, in the baseline too"

MANOEUVRES = (SWEEPS, CIRCLES, THROTTLE, FULL_THROTTLE, COASTING, STANDING, FULL_CIRCLES, BOTH_WAYS, DRIFTS)
"""In the order in which they are proposed."""
