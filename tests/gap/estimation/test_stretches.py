"""What of a run is used and what is not: stretches that cover it, each with its reason."""

import numpy as np

from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.usable import admit, stretches


def test_stretches_cover_a_run_and_agree_with_what_is_used():
    t = 0.01 * np.arange(1500)
    v = np.where((t > 5.0) & (t < 6.0), 0.2 + 0.02 * np.sin(9.0 * t), 12.0 + 0.1 * np.sin(t))
    run = Run("drive", t=t, r=0.1 * np.sin(2.0 * t), v=v, delta_cmd=0.02 * np.sin(2.0 * t))
    (found,) = stretches([run], VehicleParameters())
    used = [(one.start, one.stop) for one in found if not one.why]
    assert used == [(part.t[0], part.t[-1]) for part in admit([run], VehicleParameters()).runs]
    (cut,) = [one for one in found if one.why]
    assert "slower than" in cut.why
    assert (round(cut.start, 2), round(cut.stop, 2)) == (5.01, 5.99)
