"""The gap between a car's logs and its simulator: where it is, which effect causes it, how far it shrinks.

`diagnose.diagnose` is the way in. An extended Kalman filter over the car and the effects' own states (`filter`) turns
logs into whitened innovations; a joint Gauss-Newton over an effect's magnitude and the vehicle file's tolerances
(`fit`) gives each hypothesis its Laplace evidence; `search` finds the hypotheses that are worth it; `freeform` measures
what the best of them leaves, from which `posterior` weighs `unknown`; `where` and `reduction` say the rest.
"""
