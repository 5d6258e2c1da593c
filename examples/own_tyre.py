"""Your own tyre: one function, which a package of yours names in its pyproject.toml:

    [project.entry-points."drift_drake.tyres"]
    smooth = "my_package.own_tyre:smooth"

Once that is installed, a vehicle file may say `tyre: smooth`; plants, controllers and the diagnosis then use it.
"""

from typing import Any

import numpy as np

from drift_drake.car.scalar import tanh
from drift_drake.car.tyre import brush_secant


def smooth(sigma: Any, stiffness: Any, peak: Any) -> tuple[Any, Any]:
    """Force over slip and its derivative [N] of a tyre without a kink: F = peak tanh(C sigma / peak)."""
    grip = tanh(stiffness * sigma / peak)
    secant, slope = peak * grip / sigma, stiffness * (1.0 - grip * grip)
    return secant, (slope - secant) / sigma


def main() -> Any:
    """Forces [N] at some slips, of this tyre and of the brush [2, n]."""
    slips = np.array([0.01, 0.05, 0.1, 0.2])
    forces = np.array([slips * tyre(slips, 1.4e5, 8000.0)[0] for tyre in (smooth, brush_secant)])
    for name, row in zip(("smooth", "brush"), forces, strict=True):
        print(f"{name}: " + ", ".join(f"{force:.0f} N at {slip:g}" for slip, force in zip(slips, row, strict=True)))
    return forces


if __name__ == "__main__":
    main()
