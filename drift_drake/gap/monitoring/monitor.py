"""The monitor as plain functions: one row in, and every tenth of a second a verdict out."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.driving import slowest
from drift_drake.car.log.plausible import ABSURD
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import NoiseLevels
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.prior import TOLERANCE_OF
from drift_drake.gap.estimation.problem import PROCESS_NOISE
from drift_drake.gap.estimation.reduction import STATES
from drift_drake.gap.monitoring import bank as filters
from drift_drake.gap.monitoring.bank import Bank, BankState, Node, allowance, gated_row, make_bank, make_nodes, on_bank
from drift_drake.gap.monitoring.events import SIGNALS, SoFar, no_verdict, nothing_seen
from drift_drake.gap.monitoring.evidence import (
    ALARM,
    TRUSTED,
    EvidenceProblem,
    Sums,
    evidence_problem,
    no_sums,
    renewed,
    verdict_of,
    whitened,
)
from drift_drake.gap.monitoring.history import History, no_history, of_parts, since, until, with_block

BLOCK = 0.1  # [s] between verdicts
SETTLING = 0.35  # [s] after the first row that do not count: commands before it are unknown
CLIPPED = 8.0  # root of squares at which a row's innovations are clipped (Huber)
PROCESS_SCALE = 3.0  # of the process noise of `estimation`: a filter that forgets sooner sees a change sooner
FORGETTING = 0.8  # of what came before, each time that 6.4 s join it
# The rim speed is logged with the radius that the file states.
TOLERANCES = TOLERANCE_OF | {"wheel_radius_error": "wheel_radius"}
SPIN = 1.2  # [rad]


class State(NamedTuple):
    """What is carried from row to row."""

    clock: np.ndarray  # [4] rows since the start (0: not started), rows in the block, blocks since a change (0: none),
    # and rows that may be left out
    bank: BankState
    block: Sums
    history: History[Sums]
    seen: SoFar
    verdict: np.ndarray  # posterior; magnitude and interval of the leading effect; time of the change [s]


@dataclasses.dataclass(frozen=True)
class Monitor:
    """What does not change during a drive."""

    bank: Bank
    used: np.ndarray  # [9] channels
    problem: EvidenceProblem
    slowest: float  # [m/s] below which the equations are not judged
    alarm: float = ALARM  # probability of none below which a change is reported

    @property
    def period(self) -> float:
        """Between rows [s]."""
        return self.bank.period

    @property
    def block(self) -> float:
        """Between verdicts [s]."""
        return BLOCK

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the posterior's entries: none, the effects, unknown."""
        return self.problem.labels

    def start(self) -> State:
        """Before the first row."""
        n = len(self.problem.nodes)
        nothing = no_sums(n)
        return State(np.zeros(4), filters.make_state(self.bank), nothing, no_history(nothing), nothing_seen(n),
                     no_verdict(self.labels))  # fmt: skip

    def after_row(self, state: State, y: np.ndarray, command: np.ndarray, t: float, road: float = 0.0) -> State:
        """See `events.Watcher`."""
        state = row_taken(self, state, y, command, road)
        return _closed(self, state, t) if state.clock[1] >= max(round(BLOCK / self.bank.period), 1) else state

    def at_edge(self, state: State) -> tuple[np.ndarray, np.ndarray] | None:
        """See `events.Watcher`."""
        ages, recent = since(state.history)
        edge = state.clock[2]
        if edge == 0.0 or not len(ages):
            return None
        i = int(np.argmin(np.abs(ages - edge)))
        w, m = whitened(
            self.problem, *(of_parts(sums, by=lambda a: a[i : i + 1]) for sums in (recent, until(state.history)))
        )
        return w[0], m[0]

    def judges(self) -> str:
        """See `events.Watcher`."""
        return (
            f"the equations hold above {self.slowest:.2g} m/s and below {SPIN:g} rad of sideslip, and the filter needs "
            "a third of a second"
        )


def seen(used: Sequence[str]) -> list[str]:
    """Effects that the measured channels `used` can show; the commands are known.

    Live, commands do not act before they are given, and that they act later is a latency of the sensors.
    """
    return [name for name, info in CATALOGUE.items() if set(info.needs) <= {*used, "tau_cmd"} and not info.hastens]


def make_monitor(
    vehicle: VehicleParameters, own: Effects | None = None, used: Sequence[str] = STATES, period: float = 0.01,
    noise: NoiseLevels | None = None,
) -> Monitor:  # fmt: skip
    """A monitor of the simulator's car.

    Args:
        vehicle, own: the simulator's car; used: measured channels (of `CHANNELS`, x and y are of no use here);
        period: [s] between rows; noise: of the sensors.
    """
    own, noise = own or Effects(), noise or NoiseLevels()
    nodes = make_nodes(seen(used), vehicle)
    levels = np.array([max(getattr(noise, name), 1e-6) for name in CHANNELS])
    bank = make_bank(nodes, vehicle, own, period, levels**2, (PROCESS_SCALE * PROCESS_NOISE) ** 2)
    mask = np.array([name in used for name in CHANNELS])
    problem = evidence_problem(nodes, tolerances(nodes, vehicle))
    return Monitor(bank, mask, problem, slowest(vehicle))


def tolerances(nodes: Sequence[Node], vehicle: VehicleParameters) -> np.ndarray:
    """Standard deviation [n] of each node's amplitude within the vehicle file's tolerances."""
    out = np.zeros(len(nodes))
    for i, node in enumerate(nodes):
        tolerance = TOLERANCES.get(node.name)
        if tolerance:
            out[i] = abs(float(getattr(vehicle.tolerance, tolerance)) / node.magnitude)
    return out


def row_taken(monitor: Monitor, state: State, y: np.ndarray, command: np.ndarray, road: float = 0.0) -> State:
    """The state with one more row in its block, as `events.Watcher.after_row` wants it; an effect `road_bank` comes to
    the road's."""
    used = monitor.used & (np.abs(y) < ABSURD)
    commanded = bool((np.abs(command) < ABSURD).all())
    y = np.where(used, y, 0.0)
    rows, filled, edge, left = state.clock
    if rows == 0.0:
        if not used[:2].all() or not commanded:
            return state
        bank = filters.make_state(monitor.bank)
        filters.start_bank(y, used, command, monitor.bank, bank)
        return state._replace(clock=np.array([1.0, filled, edge, allowance(monitor.bank)]), bank=bank)
    if not commanded:
        command = state.bank.commands[-1].copy()
    bank, innovations, left = gated_row(on_bank(monitor.bank, road), state.bank, left, y, used, command)
    if not np.isfinite(bank.z).all():  # all cars of the bank begin anew at the next row, and what was found stays
        return state._replace(clock=np.array([0.0, filled, edge, left]))
    block, (_, v, beta) = state.block, bank.z[0, :3]
    settled = rows * monitor.bank.period >= SETTLING
    if innovations is not None and settled and v > monitor.slowest and abs(beta) < SPIN:
        block = with_row(block, innovations, used)
    return state._replace(clock=np.array([rows + 1.0, filled + 1.0, edge, left]), bank=bank, block=block)


def with_row(block: Sums, innovations: np.ndarray, used: np.ndarray) -> Sums:
    """The block with one more row of innovations [1 + n, 9]."""
    nu = innovations[0][used]
    signatures = nu - innovations[1:][:, used]
    squares = float(nu @ nu)
    share = min(1.0, CLIPPED**2 / max(squares, 1e-12))
    return Sums(
        block.rows + 1.0, block.energy + share * squares, block.freedom + len(nu),
        block.score + share * (signatures @ nu), block.information + share * (signatures @ signatures.T),
    )  # fmt: skip


def _closed(monitor: Monitor, state: State, t: float) -> State:
    """A block is full: it joins the history, which is judged anew."""
    rows, _, edge, left = state.clock
    if state.block.rows == 0.0:
        return state._replace(clock=np.array([rows, 0.0, edge, left]))
    n = len(monitor.problem.nodes)
    history = with_block(state.history, state.block, FORGETTING, edge)
    verdict = verdict_of(monitor.problem, history, BLOCK)
    if verdict.probabilities[0] < TRUSTED:
        history, verdict = renewed(monitor.problem, history, verdict, BLOCK)
    edge = verdict.edge if verdict.probabilities[0] < TRUSTED else 0.0
    seen = SoFar(state.seen.time + np.array([BLOCK, 0.0, 0.0, 0.0]), np.maximum(state.seen.shown, verdict.shown),
                np.stack([state.bank.reading, state.bank.predicted])[:, : len(SIGNALS)])  # fmt: skip
    return State(np.array([rows, 0.0, edge, left]), state.bank, no_sums(n), history, seen, verdict.at(t))
