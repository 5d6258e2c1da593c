"""GapMonitor: the monitor as a system in a diagram."""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.estimation.filter_state import CHANNELS
from drift_drake.monitoring.bank import BankState
from drift_drake.monitoring.evidence import TRUSTED
from drift_drake.monitoring.history import Sums
from drift_drake.monitoring.monitor import Monitor, State, after_row
from drift_drake.sensing.sensors import LOG_ROW, MEASURED_STATE

_MEASURED = [CHANNELS.index(name) for name in ("r", "v", "beta", "omega_r")]
_FURTHER = {name: LOG_ROW.index(name) for name in ("psi", "ax", "ay")}


class GapMonitor(LeafSystem):
    """Says while the car drives what the simulator lacks, since when and by how much.

    Input ports:
        measured_state [7]: (r, v, beta, omega_r, e, dphi, s); NaN where there is no reading.
        command [2]: (delta [rad], tau [N m]) in force.
        log_row [10] (optional): `sensors.LOG_ROW`, of which psi, ax and ay are used where the monitor uses them.

    Output ports, new every 0.1 s and held in between:
        posterior: probabilities of `monitor.labels`: none, each effect, unknown.
        magnitude [3]: of the leading effect, and its 95 % interval; in the catalogue's unit.
        onset [1]: time of the change [s], NaN while none is more probable.
        trusted [1]: 1 while the simulator may be believed (none at 0.5 or more), else 0.

    State in the Context, all discrete, each period of the monitor: a `monitor.State`, one group an array.
    """

    def __init__(self, monitor: Monitor) -> None:
        LeafSystem.__init__(self)
        self.monitor = monitor
        self._measured = self.DeclareVectorInputPort("measured_state", len(MEASURED_STATE))
        self._command = self.DeclareVectorInputPort("command", 2)
        self._log_row = self.DeclareVectorInputPort("log_row", len(LOG_ROW))
        arrays = _arrays(monitor.start())
        self._shapes = [a.shape for a in arrays]
        self._groups = [self.DeclareDiscreteState(a.ravel()) for a in arrays]
        self.DeclarePeriodicDiscreteUpdateEvent(monitor.bank.period, 0.0, self._update)
        verdict = {self.discrete_state_ticket(self._groups[-1])}
        for name, size, calc in (
            ("posterior", len(monitor.labels), lambda context: self.state(context).verdict[:-4]),
            ("magnitude", 3, lambda context: self.state(context).verdict[-4:-1]),
            ("onset", 1, self._onset),
            ("trusted", 1, lambda context: [float(self._trusted(context))]),
        ):
            self.DeclareVectorOutputPort(
                name, size, lambda context, output, calc=calc: output.SetFromVector(calc(context)),
                prerequisites_of_calc=verdict,
            )  # fmt: skip

    def state(self, context: Context) -> State:
        """The state in a Context of this system."""
        groups = zip(self._groups, self._shapes, strict=True)
        return _state([context.get_discrete_state(group).value().reshape(shape) for group, shape in groups])

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        y = np.full(len(CHANNELS), np.nan)
        y[_MEASURED] = self._measured.Eval(context)[:4]
        if self._log_row.HasValue(context):
            row = self._log_row.Eval(context)
            for name, at in _FURTHER.items():
                y[CHANNELS.index(name)] = row[at]
        before = self.state(context)
        after = after_row(self.monitor, before, y, np.array(self._command.Eval(context)), context.get_time())
        for group, new, old in zip(self._groups, _arrays(after), _arrays(before), strict=True):
            if new is not old:
                discrete.set_value(group, new.ravel())

    def _trusted(self, context: Context) -> bool:
        return bool(self.state(context).verdict[0] >= TRUSTED)

    def _onset(self, context: Context) -> list[float]:
        return [np.nan if self._trusted(context) else float(self.state(context).verdict[-1])]


def _arrays(state: State) -> list[np.ndarray]:
    """All arrays of a state, in the order of the Context's groups."""
    return [state.clock, *state.bank, *(np.atleast_1d(a) for a in state.block), state.history, state.verdict]


def _state(arrays: list[np.ndarray]) -> State:
    """The inverse of `_arrays`."""
    clock, *rest = arrays
    bank, block = BankState(*rest[:5]), Sums(*(a[0] for a in rest[5:8]), *rest[8:10])
    return State(clock, bank, block, rest[10], rest[11])
