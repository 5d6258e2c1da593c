"""Units by name, and the dimension that each quantity of the log must have."""

import math

DIMENSIONS = {  # of a quantity: its SI unit, and the factors to it
    "time": ("s", {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}),
    "length": ("m", {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "ft": 0.3048}),
    "angle": ("rad", {"rad": 1.0, "deg": math.pi / 180.0, "rev": 2.0 * math.pi}),
    "speed": ("m/s", {"m/s": 1.0, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "mph": 0.44704, "kn": 1852.0 / 3600.0}),
    "angular rate": (
        "rad/s",
        {"rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0, "rev/s": 2.0 * math.pi},
    ),
    "acceleration": ("m/s^2", {"m/s^2": 1.0, "mm/s^2": 1e-3, "g": 9.80665, "mg": 9.80665e-3}),
    "torque": ("N m", {"N m": 1.0, "kN m": 1e3, "lb ft": 1.3558179}),
    "force": ("N", {"N": 1.0, "kN": 1e3}),
    "number": ("-", {"-": 1.0, "%": 0.01}),
}

QUANTITIES = {  # that the importer knows by name; other names are inputs of the mapping's own formulas
    "x": "length",
    "y": "length",
    "psi": "angle",
    "r": "angular rate",
    "v": "speed",
    "vx": "speed",
    "vy": "speed",
    "beta": "angle",
    "omega_r": "speed",
    "ax": "acceleration",
    "ay": "acceleration",
    "az": "acceleration",
    "delta_cmd": "angle",
    "tau_cmd": "torque",
}


def dimension(unit: str) -> str | None:
    """Dimension of a unit, None if the unit is unknown."""
    return next((name for name, (_, factors) in DIMENSIONS.items() if unit in factors), None)


def units_of(name: str) -> list[str]:
    """Units that a quantity may be recorded in; of a wheel speed, angular rates too (they take a radius)."""
    kind = QUANTITIES.get(name)
    known = list(DIMENSIONS) if kind is None else [kind, "angular rate"] if name == "omega_r" else [kind]
    return [unit for each in known for unit in DIMENSIONS[each][1]]


def factor(unit: str) -> float:
    """What to multiply with to come to SI."""
    return DIMENSIONS[dimension(unit) or "number"][1][unit]
