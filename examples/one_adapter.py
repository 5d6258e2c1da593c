"""The adapter without the loop: it makes a sample of two readings that are 0.1 s apart."""

import numpy as np

from drift_drake import BayesianAdapter, load_model


def main() -> tuple[float, float]:
    """How many samples the adapter took, and by how much its belief has moved."""
    adapter = BayesianAdapter(load_model())
    context = adapter.CreateDefaultContext()
    prior = adapter.GetOutputPort("posterior_mean").Eval(context)
    for t, v in ((0.0, 15.0), (0.1, 14.9)):
        context.SetTime(t)
        adapter.GetInputPort("measured_state").FixValue(context, [0.0, v, 0.0, v, 0.0, 0.0, 15.0 * t])
        adapter.GetInputPort("command").FixValue(context, [0.0, 0.0])
        adapter.GetInputPort("lagged_command").FixValue(context, [0.0, 0.0])
        adapter.ExecuteForcedEvents(context)
    taken, _ = adapter.GetOutputPort("counters").Eval(context)
    return float(taken), float(np.linalg.norm(adapter.GetOutputPort("posterior_mean").Eval(context) - prior))


if __name__ == "__main__":
    print(main())
