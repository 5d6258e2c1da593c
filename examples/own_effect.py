"""Your own effect: a record and its physics, which a package of yours names in its pyproject.toml:

    [project.entry-points."drift_drake.effects"]
    side_wind = "my_package.own_effect:SIDE_WIND"

Once that is installed, plants, the filter, `drift-drake diagnose` and vehicle files know `side_wind`.
"""

from typing import Any

from drift_drake import Effect, VehicleParameters
from drift_drake.car.scalar import cos, sin


def side_wind(r: Any, v: Any, beta: Any, omega_r: Any, psi: Any, car: Any, magnitude: Any) -> Any:
    """A wind along the fixed frame's y: force in the body frame [N], yaw moment [N m]."""
    return magnitude * sin(psi), magnitude * cos(psi), 0.3 * magnitude


SIDE_WIND = Effect(
    "N", -1500.0, 1500.0, "a wind acts with q along the fixed frame's y",
    needs=("psi",), mass=1.0, shown_by="straight stretches there and back", force=side_wind,
)  # fmt: skip


def main() -> tuple[float, float, float]:
    """The force on a car that heads along x."""
    car = VehicleParameters()
    force: tuple[float, float, float] = side_wind(0.0, 20.0, 0.0, 20.0, 0.0, car.constants(), 800.0)
    low, high = SIDE_WIND.range_for(car.replace(mass=825.0))
    print(f"800 N of wind act with {force}; a car of half the mass has {low:.0f} to {high:.0f} N")
    return force


if __name__ == "__main__":
    main()
