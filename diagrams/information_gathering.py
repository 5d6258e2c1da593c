"""Information gathering on one vehicle: check the steering, plan, execute with the tracking controller, log,
decimate, adapt; then which model to drive with, the car that the informative drives identify or the learnt one.

python -m diagrams.information_gathering --vehicle 3     # one vehicle: OCP, Info-OCP, second Info-OCP
python -m diagrams.information_gathering --graph         # draws the diagram of the execution
"""

import dataclasses
from functools import partial
from pathlib import Path

from diagrams.command import run_command
from drift_drake.car.log.cases import runs_of
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import make_run_folder
from drift_drake.drive.gathering.gather import check_steering, execution, learn_drives, taught, with_steering
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory, plan_again, plan_drive
from drift_drake.drive.gathering.rehearsed_plan import boldest
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.posterior import Posterior, covariance_norms
from drift_drake.gap.choose.choice import ask
from drift_drake.view.pictures.graph import draw_graph
from experiments.benchmarks.vehicles import Population, draw_effects
from experiments.gathering.recipe import Recipe


@dataclasses.dataclass(frozen=True)
class Options(Recipe):
    """One vehicle's information gathering."""

    vehicle: int = 0
    population: Population = "validation"
    seed: int = 0
    graph: bool = False
    """Only draw the diagram of the execution."""
    out: Path | None = None


def main(options: Options) -> None:
    """Runs, or draws the diagram, and prints the covariance norms of the four models."""
    options = options.resolved()
    model, config, parameters = load_model(options.checkpoint), options.gathering, VehicleParameters()
    effects = draw_effects(options.population, options.vehicle, 0)
    if config.checks and not options.graph:
        model, config = with_steering(model, config, check_steering(effects, parameters, config, options.seed))
    beliefs = {"prior": model.prior()}
    nominal = plan_drive(model, beliefs["prior"], config, 0.0)
    if options.graph:
        diagram = execution(nominal, effects, parameters, config).diagram
        for path in draw_graph(
            diagram, make_run_folder("information_gathering", options.out) / "information_gathering"
        ):
            print(path)
        return
    driven = []
    if not config.steering.usual:
        print(f"a slow drive shows {config.steering.sentence()}")
    print(f"{'model':>12}  {'r':>9} {'v':>9} {'beta':>9} {'omega_r':>9} {'total':>9}   (alpha {config.alpha:g})")

    def planned(name: str, share: float) -> Trajectory:
        if name == "Once-Info":
            return plan_drive(model, beliefs["prior"], config, share * config.alpha, options.seed)
        return plan_again(model, beliefs["Once-Info"], first, config, options.seed + 1, share)

    first = boldest(partial(planned, "Once-Info"), parameters, config)
    _report("prior", beliefs["prior"])
    for name, before in (("Once-OCP", "prior"), ("Once-Info", "prior"), ("Twice-Info", "Once-Info")):
        trajectory = {"Once-OCP": nominal, "Once-Info": first}.get(name)
        if trajectory is None:
            try:
                trajectory = boldest(partial(planned, name), parameters, config)
            except InfeasiblePlanError as error:
                print(f"{name:>12}  not driven: {error}")
                break
        drive = taught(model, beliefs[before], trajectory, effects, parameters, config, options.seed)
        beliefs[name] = drive.belief
        driven += [drive.table] if name != "Once-OCP" else []
        _report(name, drive.belief)
        e, beta = (drive.table[column].abs().max() for column in ("e", "beta"))
        print(
            f"{'':>12}  planned {drive.expected:.1f} nat ({trajectory.status}), gained {drive.obtained:.1f}; driven: "
            f"|e| <= {e:.2f} m, |beta| <= {beta:.2f} rad, ended by {drive.ending}"
        )
    if config.learn_lags and "Twice-Info" in beliefs:
        model, beliefs["Twice-Info"] = learn_drives(model, driven, config)
        lags = f"{model.lag[0]:.3g} s (steering) and {model.lag[1]:.3g} s (torque)"
        print(f"both drives are likeliest with lags of {lags}")
    print(ask(runs_of(driven), parameters, steering=config.steering).sentence())


def _report(name: str, belief: Posterior) -> None:
    norms, total = covariance_norms(belief)
    print(f"{name:>12}  " + " ".join(f"{norm:9.3g}" for norm in [*norms, total]))


if __name__ == "__main__":
    run_command(main, Options)
