"""What logs tell of a car: the equations' parameters as unknowns, predictions and innovations, fits.

`identification` (calibrating a car) and `diagnosis` (naming a gap) are its clients. Two criteria are here: the
likelihood of an extended Kalman filter (`problem`, `filter`, `fit`), exact where the car follows the equations, and
robust prediction errors some tenths of a second ahead (`windows`), for cars that no single-track model follows.
"""
