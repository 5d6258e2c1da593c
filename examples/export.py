"""Export: a corrected car as a MuJoCo model and for CommonRoad, and a log as a table of another tool."""

from pathlib import Path

from drift_drake import VehicleParameters, make_effects, read_run
from drift_drake.cli.demo import SAMPLE_LOG
from drift_drake.view.exporting.logs import columns_of
from drift_drake.view.exporting.vehicles import write_commonroad, write_mujoco


def main(folder: Path = Path()) -> list[str]:
    """Writes car.xml and car.yaml; returns the log's columns with their units."""
    car, effects = VehicleParameters(), make_effects({"front_stiffness_error": 0.36})  # found by a diagnosis, say
    write_mujoco(car, effects, folder / "car.xml")
    write_commonroad(car, effects, folder / "car.yaml")
    columns = columns_of(read_run(str(SAMPLE_LOG / "run_0.csv.gz")))  # `write_parquet`, `write_mcap` write them
    print(f"{folder / 'car.xml'}, {folder / 'car.yaml'}; the log has {', '.join(columns)}")
    return list(columns)


if __name__ == "__main__":
    main()
