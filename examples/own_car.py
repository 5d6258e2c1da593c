"""Your own car: its parameters in a vehicle file, an additional effect, and a log of it driving."""

from pathlib import Path

import numpy as np
from pydrake.systems.primitives import ConstantVectorSource

from drift_drake import Drive, Plan, VehicleParameters, make_effects, read_vehicle, write_vehicle


def main(folder: Path = Path(), seconds: float = 5.0) -> float:
    """Writes my_car.yaml and my_car.csv; returns the speed at the end [m/s]."""
    car = VehicleParameters(mass=1210.0, yaw_inertia=1450.0, front_stiffness=1.1e5, rear_stiffness=1.5e5, friction=1.1)
    write_vehicle(folder / "my_car.yaml", car, make_effects({"steering_lag": 0.06, "aero_drag": 0.7}))
    parameters, effects = read_vehicle(folder / "my_car.yaml")  # checked: units, ranges, spelling
    commands = Plan(0.0, np.array([[0.0, 150.0], [0.06, 100.0]]), dt=2.0)  # steering ramps in over two seconds
    driver = ConstantVectorSource(commands.vector())
    drive = Drive(parameters, driver, 1, commands.dt, None, (0.0, 150.0), effects)
    table, ending = drive.run(np.array([0.0, 12.0, 0.0, 12.0, 0.0, 0.0]), 0.0, seconds, seed=0)
    table.to_csv(folder / "my_car.csv", index=False)
    print(f"{len(table)} rows, ended by {ending}; {table['v'].iloc[-1]:.1f} m/s at the end")
    return float(table["v"].iloc[-1])


if __name__ == "__main__":
    main()
