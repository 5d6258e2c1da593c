"""What the comparison watches with: the nominal simulator, and one calibrated on a double-track car's drives."""

import dataclasses
from pathlib import Path
from typing import Literal

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle
from drift_drake.common.run_folder import write_json
from drift_drake.gap.identification.identify import identify
from drift_drake.gap.monitoring.baselines import with_baseline_scores
from drift_drake.gap.monitoring.monitor import Monitor
from drift_drake.gap.monitoring.watch import monitor_of
from experiments.other_worlds.days import Days, first_guess, make_day
from experiments.other_worlds.drivers import DAY_ONE

CAR: Literal["coupe"] = "coupe"
SEED, DURATION = 7, 20.0


@dataclasses.dataclass(frozen=True)
class Simulator:
    """What a monitor believes of a car, and the excess of its scores on normal drives."""

    vehicle: VehicleParameters
    effects: Effects = dataclasses.field(default_factory=Effects)
    excess: np.ndarray | None = None

    def monitor(self, run: Run) -> Monitor:
        """A monitor for a log."""
        monitor = monitor_of(run, self.vehicle, self.effects)
        if self.excess is None:
            return monitor
        return dataclasses.replace(monitor, problem=monitor.problem._replace(excess=self.excess))


def double_track_simulator(folder: Path) -> Simulator:
    """The single-track simulator of the double-track coupe, calibrated on a day of normal drives; kept in a folder."""
    days = Days(Path(), car=CAR, seed=SEED, duration=DURATION)
    runs, path = make_day(days, {}, DAY_ONE, 0), folder / "coupe.yaml"
    if not path.exists():
        found = identify(runs, first_guess(CAR), case=CAR, criterion="prediction", watching=False)
        write_vehicle(path, found.vehicle, found.effects)
        write_json(folder / "calibration.json", found.calibration.sentence())
    vehicle, effects = read_vehicle(path)
    learnt = with_baseline_scores(monitor_of(runs[0], vehicle, effects), runs)
    return Simulator(vehicle, effects, learnt.problem.excess)
