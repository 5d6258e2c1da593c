"""Plan the next drive: the one that tells an answer's rival hypotheses apart best, within a straight lane."""

from drift_drake import Answer, VehicleParameters, diagnose, plan_from_answer, read_case
from drift_drake.cli.demo import SAMPLE_LOG
from drift_drake.gap.next_drive.plan import NextDrive, NextDriveConfig


def gentle() -> Answer:
    """What the first seconds of one run say: too little to be sure."""
    runs = [read_case(str(SAMPLE_LOG))[0].rows(0, 600)]
    effects = ("front_stiffness_error", "cg_shift", "yaw_inertia_error")
    return diagnose(runs, VehicleParameters(), case="gentle", catalogue=effects).answer


def main(answer: Answer | None = None, config: NextDriveConfig | None = None, out: str = "plan.csv") -> NextDrive:
    """Writes the plan: commands at 100 Hz and the states that they are expected to lead to."""
    drive = plan_from_answer(answer or gentle(), VehicleParameters(), config)
    drive.write(out)
    print(drive.sentence())
    return drive


if __name__ == "__main__":
    main()
