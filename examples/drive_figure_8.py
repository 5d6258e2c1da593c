"""Drift a figure-8: a reference, what the controller believes, the closed loop, and how well it went."""

from drift_drake import BayesianAdapter, ClosedLoop, RunLimits, VehicleParameters, figure_8, load_model, step_model


def main(time_factor: float = 1.5) -> str:
    """Drives for at most `time_factor` of the reference's own duration; returns how the run ended."""
    car = VehicleParameters()
    learnt = load_model()  # shipped; meta-trained on other cars
    loop = ClosedLoop(car, figure_8(car), step_model(learnt, learnt.prior()), adapter=BayesianAdapter(learnt))
    run = loop.run(loop.initial_context(seed=1), RunLimits(time_factor=time_factor))
    metrics = run.metrics()
    print(f"{metrics.outcome}: {metrics.completion:.0%} driven, RMS e {metrics.rms_e:.3f} m")
    return run.outcome


if __name__ == "__main__":
    main()
