"""Whether a run's numbers can be a car's at all; finer doubts are for `screening`."""

from collections.abc import Collection, Mapping

import numpy as np

LARGEST = {  # what reaches beyond these for more than a few rows is in another unit or broken; a guess at the unit
    "v": (150.0, "m/s", "km/h"),
    "beta": (np.pi, "rad", "degrees"),
    "omega_r": (200.0, "m/s", "the wheel's rad/s"),
    "ax": (100.0, "m/s^2", ""),
    "ay": (100.0, "m/s^2", ""),
    "delta_cmd": (1.2, "rad", "degrees, or the steering wheel's angle"),
    "tau_cmd": (1e5, "N m", ""),
    "bank": (1.2, "rad", "degrees"),
}
GUESSED = 60.0  # times the largest, up to which the guess is made
ABSURD = 1e6  # no number of these columns, or of the yaw rate, in any unit
REACHED = 0.99  # of the rows: a spike is for the screening to find
REVERSE = 0.5  # [m/s] of negative speed that noise explains
FAST_TURN = 7.0  # [rad/s] up to which a yaw rate is asked no questions; small cars turn faster
MOST_ACROSS = 100.0  # [m/s^2] of v r that no car and no spin holds
DEGREES = 20.0  # factor from which r or psi can only be the other's in degrees

Columns = Mapping[str, np.ndarray | None]


def implausible(columns: Columns, period: float, trusted: Collection[str] = ()) -> str | None:
    """What no car can do, in one sentence without the run's name; None where there is nothing.

    Args:
        columns: of the log format [rows], None where the log lacks one; period: time between rows [s]; trusted: names
            of columns that are asked no questions.
    """
    columns = {name: None if name in trusted else values for name, values in columns.items()}
    return _absurd(columns) or _too_large(columns) or _turning(columns, period) or _negative_speed(columns)


def _absurd(columns: Columns) -> str | None:
    for name in ("r", *LARGEST):
        values = columns.get(name)
        if values is not None and float(np.max(np.abs(values))) > ABSURD:
            row = int(np.argmax(np.abs(values)))
            return f"column {name} holds {values[row]:g} in row {row}; fill or cut it"
    return None


def _too_large(columns: Columns) -> str | None:
    for name, (largest, unit, other) in LARGEST.items():
        values = columns.get(name)
        if values is None:
            continue
        reached = float(np.quantile(np.abs(values), REACHED))
        if reached > largest:
            guess = f"; it looks like {other}, convert it" if other and reached < GUESSED * largest else ""
            return f"column {name} reaches {reached:g}, expected {unit} below {largest:g}{guess}"
    return None


def _turning(columns: Columns, period: float) -> str | None:
    """Whether yaw rate and heading can be those of one car: by each other, then by the speed."""
    r, v, psi = columns["r"], columns["v"], columns["psi"]
    if r is None or v is None:
        return None
    turned = float(np.sum(np.abs(r)) * period)
    fast = float(np.quantile(np.abs(r), REACHED))
    if psi is not None:
        # An unwrapped heading may be any number, but it cannot turn faster than the car.
        heading = float(np.sum(np.abs(np.diff(np.unwrap(psi)))))
        if heading > DEGREES * turned + 10.0 and float(np.max(np.abs(psi))) > 60.0:
            return "column psi does not agree with r; it looks like degrees, convert it"
        if fast > FAST_TURN and turned > DEGREES * heading + 10.0:
            return (
                f"column r reaches {fast:g}, and turns much more than psi; it looks like degrees per second, convert it"
            )
    across = float(np.quantile(np.abs(r * v), 0.9))
    if fast > FAST_TURN and across > MOST_ACROSS:
        return (
            f"column r reaches {fast:g}, and v r {across:.3g} m/s^2, which no car holds; it looks like degrees per "
            "second: convert it, or import it with --trust r if the car did turn that fast"
        )
    return None


def _negative_speed(columns: Columns) -> str | None:
    v = columns["v"]
    slow = 0.0 if v is None else float(np.quantile(v, 1.0 - REACHED))
    return f"column v is negative ({slow:g}); v is the speed, not a velocity" if slow < -REVERSE else None
