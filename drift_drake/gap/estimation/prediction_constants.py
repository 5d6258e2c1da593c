"""Constants of the inference by prediction: each with what it is, its unit and where it was set.

Set on the days of double-track, brush and multi-body cars of `experiments.other_worlds` and on two cars of others' open
simulators, eleven calibrations of four runs and 82 days without an effect, by the likelihood of those days' scores
(`python -m experiments.other_worlds.constants` prints what halving and doubling each does). What a car's own recordings
tell (`recordings_left_out`) replaces what such a population says.
"""

REGULAR = 1e-2  # of the errors' covariance, added to its diagonal
SHRUNK = 120.0  # blocks that the belief in scatter as the information tells is worth, relative to those that were seen
HANGS = 0.3  # correlation of what the equations lack, from block to block of one stretch
HARDER = 1.0  # power of the slip along the wheels, with which the scatter of blocks grows
SLIGHT = 0.02  # [-] of slip along the wheels, below which more of it changes little
OFF_SHAPE = 0.01  # share of a score's variance that it scatters by alone: derivatives are those of the equations
TYRES_AND_BODY = 0.2  # [units] by which what an effect on the motion is worth differs from stretch to stretch
MORE_SO = 0.6  # [units] the same, where bodies roll and pitch
PARTIAL_VARIES = 0.03  # [units] the same of a partial effect
KIND_VARIES = 0.7
"""[units] the same of what a kind of car alone has (`car.deviation`): with half of it two of eight logs without an
effect were `unknown` on a saloon of others whose differential the equations lack (sedan and mb1, validation)."""
FACTORS = (1.0, 2.0, 4.0, 8.0)
"""By which one car's equations lack more from stretch to stretch than these four say. Factors below one would add two
false alarms in eight logs of a van (validation); real cars ask for up to eight."""
FACTOR_SPREAD = 1.0  # standard deviation of their natural logarithm, from car to car
KIND_PRIOR = 2.0  # [units] by which a calibrated car always deviates in it, before its scores
PARTIAL_PRIOR = 0.1  # [units] by which a car always deviates in a partial effect, before its logs
LEFT_OF_FITTED = 0.5  # of the deviation before calibration of an effect that was fitted, what may be left after it
LEFT_OF_OTHERS = 0.25  # the same of an effect that was not: most cars have none of it
SCALE, SCALE_WORTH = 0.5, 0.5  # of the scatter of a recording, of all cars; recordings that this belief is worth
FROM_LEFT_OUT = 2.5  # by which that scale is larger than what recordings left out show: each is of one kind of driving
ODD = 4.0  # times the median distance, beyond which a recording left out sets no scale
CALIBRATED = 4.0  # by how much what calibration left unknown of a parameter is wider than its own logs say
MODEL_FORM = {"yaw_inertia_error": 0.08}
"""Standard deviation from manoeuvre to manoeuvre of what an effect of the equations is worth: where a body rolls and
tyres relax, the yaw inertia that predicts best depends on the drive."""
