"""Diagnose logs: where the simulator is wrong, which effect it lacks, and the corrected car."""

from collections.abc import Sequence

from drift_drake import CATALOGUE, Answer, VehicleParameters, corrected_vehicle, diagnose, read_case, write_vehicle
from drift_drake.cli.demo import SAMPLE_LOG


def main(
    rows: int | None = None,
    effects: Sequence[str] = tuple(CATALOGUE),
    answer: str | None = "answer.json",
    corrected: str | None = "corrected.yaml",
) -> Answer:
    """Diagnoses the sample log, the first `rows` of each run; writes the answer and the corrected vehicle file."""
    car = VehicleParameters()  # what its simulator believes
    runs = [run.rows(0, rows or len(run)) for run in read_case(str(SAMPLE_LOG))]
    found = diagnose(runs, car, case="sample", catalogue=effects).answer
    print(found.sentence())
    for name, probability in list(found.posterior.items())[:3]:
        print(f"  {name}: probability {probability:.3f}")
    if answer:
        found.write(answer)
    if corrected:
        write_vehicle(corrected, *corrected_vehicle(car, found))
    return found


if __name__ == "__main__":
    main()
