"""How much is asked of a simulator of the user's that is slow: fewer windows, and derivatives that are used longer."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants
from drift_drake.car.foreign.pool import cost_of, listening, workers_here
from drift_drake.car.foreign.simulator import SimulatorConstants
from drift_drake.common.errors import significant
from drift_drake.common.standard_output import Progress
from drift_drake.gap.estimation.unknowns import DIFFERENCE
from drift_drake.gap.estimation.windows import WindowedRun, errors, thinned

EVALUATION = 0.4  # [s] that the predictions of all windows by one car may take, about
LEAST_WINDOWS = 100
SLOW = 1e-3  # [s] of a roll-out, from where on derivatives are used at cars near by too
NEAR = 0.2  # units of the unknowns, within which they are
ROUGH = 0.1  # of a unit, for derivatives of a simulator, whose contacts and tolerances make small differences noise
SHOWN = 0.15  # share done from where on it is said how much is left
PROBED = 8  # windows a worker, that a simulator's cost is taken from
PROBED_AT_ONCE = 250  # the same where it answers many at once


def affordable(constants: CarConstants, runs: Sequence[WindowedRun], most: int) -> int:
    """Windows that predictions by a car are asked for, `most` where they cost little.

    Args:
        runs: some windows of which a simulator is asked for, where it has not been asked for any yet.

    Raises:
        SimulatorError: it cannot be run.
    """
    if not isinstance(constants, SimulatorConstants):
        return most
    simulator = constants.simulator
    if simulator.windows:
        return min(most, simulator.windows)
    if cost_of(simulator).count == 0:
        probed = PROBED_AT_ONCE if simulator.batch else PROBED
        errors(thinned(runs, probed * workers_here()), constants, Effects())
    can = int(EVALUATION * workers_here() / max(cost_of(simulator).seconds, 1e-9))
    return min(most, max(can, LEAST_WINDOWS))


def is_slow(constants: CarConstants) -> bool:
    """Whether predictions cost so much that derivatives are to be used longer."""
    if not isinstance(constants, SimulatorConstants):
        return False
    return bool(constants.simulator.windows) or cost_of(constants.simulator).seconds > SLOW


def derivatives_of(constants: CarConstants) -> tuple[float, float]:
    """Units of the unknowns within which derivatives are used again, and that they are taken over."""
    rough = ROUGH if isinstance(constants, SimulatorConstants) else DIFFERENCE
    return NEAR if is_slow(constants) else 0.0, rough


@contextmanager
def counted(progress: Progress, constants: CarConstants) -> Iterator[Progress]:
    """The progress with the roll-outs that a simulator has done, and that are left, about; as it is for other cars."""
    if not isinstance(constants, SimulatorConstants):
        yield progress
        return
    simulator, began, last = constants.simulator, cost_of(constants.simulator).count, [("", 0.0)]

    def show(stage: str, share: float) -> None:
        last[0] = stage, share
        again()

    def again() -> None:
        done, (stage, share) = cost_of(simulator).count - began, last[0]
        left = f", some {significant(done / share - done, 1)} left" if share > SHOWN else ""
        progress(f"{stage}: {done} roll-outs{left}", share)

    with listening(again):
        yield show


def remarks(constants: CarConstants, used: int, of: int) -> list[str]:
    """What is to be said of a simulator's roll-outs: what it lacks, fewer windows, those that failed."""
    if not isinstance(constants, SimulatorConstants):
        return []
    cost = cost_of(constants.simulator)
    out = [f"not judged, since the simulator cannot have it: {sentence}" for sentence in constants.simulator.left_out()]
    if used < of:
        out.append(
            f"the simulator takes {1e3 * cost.seconds:.2g} ms for a roll-out: {used} windows of {of} are "
            "used, evenly chosen; 'windows:' in its file asks for more, which take longer and show smaller effects"
        )
    return [*out, *([cost.sentence()] if cost.failed else [])]
