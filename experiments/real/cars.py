"""The first guesses of the real cars, with their sources, and what is stated of the small one's rim speed.

Its encoder's readings come at 10 Hz, interpolated in between: no measurement of every row, so their noise is stated
that much larger; without them nothing would tell spinning wheels from gripping ones.
"""

from pathlib import Path

from drift_drake.car.parameters import VehicleParameters

VEHICLES = Path(__file__).parent / "vehicles"
SMALL_CAR = VehicleParameters.from_yaml(VEHICLES / "small_car.yaml")
RACER = VehicleParameters.from_yaml(VEHICLES / "racer.yaml")
RIM_SPEED = {"omega_r": "wheel"}
RIM_NOISE = {"omega_r": 0.2}  # [m/s]
