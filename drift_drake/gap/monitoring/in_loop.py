"""The monitor in a closed loop's diagram: its wires, what is logged of it, and the events of a run."""

from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd
from pydrake.systems.framework import Context, DiagramBuilder, DiscreteValues, LeafSystem, OutputPort

from drift_drake.car.effects.magnitudes import COUNT
from drift_drake.car.internal_states import RememberingStepModel
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import LOG_ROW, MEASURED_STATE
from drift_drake.car.step_model import StepModel
from drift_drake.common.updates import declare_update
from drift_drake.drive.loop.watch import LoopPorts, Watched
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.monitoring.correction import GapCorrection, SlowDown
from drift_drake.gap.monitoring.events import Events, Watcher
from drift_drake.gap.monitoring.evidence import TRUSTED
from drift_drake.gap.monitoring.watch import VerdictAt
from drift_drake.gap.monitoring.windowed.sums import harder

_MEASURED = [CHANNELS.index(name) for name in ("r", "v", "beta", "omega_r")]
_FURTHER = {name: LOG_ROW.index(name) for name in ("psi", "ax", "ay")}
PREFIX = "gap_"  # of a run's columns: probabilities by name, and the leading effect's magnitude and onset
FURTHER = ("magnitude", "low", "high")
NOT_JUDGED = ("not_judged", "harder")
Policy = Literal["watch", "correct", "slow", "correct_or_slow", "forget"]
"""What follows from a gap: nothing; what is named is corrected; the car is slowed down; slow until it is corrected; an
adapter forgets."""
CORRECTING: tuple[Policy, ...] = ("correct", "correct_or_slow")
SLOWING: tuple[Policy, ...] = ("slow", "correct_or_slow")


class GapMonitor(LeafSystem):
    """Says while the car drives what the simulator lacks, since when and by how much.

    Input ports:
        measured_state [7]: (r, v, beta, omega_r, e, dphi, s); NaN where there is no reading.
        command [2]: (delta [rad], tau [N m]) in force.
        log_row [10] (optional): `sensors.LOG_ROW`, of which psi, ax and ay are used where the monitor uses them.

    Output ports, new with every verdict (each 0.1 s, or with every window) and held in between:
        posterior: probabilities of `monitor.labels`: none, each effect, unknown.
        magnitude [3]: of the leading effect, and its 95 % interval; in the catalogue's unit.
        onset [1]: time of the change [s], NaN while none is more probable.
        trusted [1]: 1 while the simulator may be believed (none at 0.5 or more), else 0.
        not_judged [2]: seconds in a row until now that were driven harder than calibrated, and by what (`harder`).

    State in the Context, all discrete, each period of the monitor: its `State`, one group an array.
    """

    def __init__(self, monitor: Watcher) -> None:
        LeafSystem.__init__(self)
        self.monitor = monitor
        self._measured = self.DeclareVectorInputPort("measured_state", len(MEASURED_STATE))
        self._command = self.DeclareVectorInputPort("command", 2)
        self._log_row = self.DeclareVectorInputPort("log_row", len(LOG_ROW))
        self._start = monitor.start()
        self._groups = [self.DeclareDiscreteState(a.ravel()) for a in arrays_of(self._start)]
        declare_update(self, monitor.period, self._update)
        verdict, time = self._groups[-1], self._groups[len(arrays_of(self._start[: self._start._fields.index("seen")]))]
        for name, size, group, calc in (
            ("posterior", len(monitor.labels), verdict, lambda context: self.state(context).verdict[:-4]),
            ("magnitude", 3, verdict, lambda context: self.state(context).verdict[-4:-1]),
            ("onset", 1, verdict, self._onset),
            ("trusted", 1, verdict, lambda context: [float(self._trusted(context))]),
            ("not_judged", 2, time, lambda context: context.get_discrete_state(time).value()[2:]),
        ):
            self.DeclareVectorOutputPort(
                name, size, lambda context, output, calc=calc: output.SetFromVector(calc(context)),
                prerequisites_of_calc={self.discrete_state_ticket(group)},
            )  # fmt: skip

    def state(self, context: Context) -> Any:
        """The monitor's state in a Context of this system."""
        return rebuilt(self._start, (context.get_discrete_state(group).value() for group in self._groups))

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        y = np.full(len(CHANNELS), np.nan)
        y[_MEASURED] = self._measured.Eval(context)[:4]
        if self._log_row.HasValue(context):
            row = self._log_row.Eval(context)
            for name, at in _FURTHER.items():
                y[CHANNELS.index(name)] = row[at]
        before = self.state(context)
        after = self.monitor.after_row(before, y, np.array(self._command.Eval(context)), context.get_time())
        for group, new, old in zip(self._groups, arrays_of(after), arrays_of(before), strict=True):
            if new is not old:
                discrete.set_value(group, new.ravel())

    def _trusted(self, context: Context) -> bool:
        return bool(self.state(context).verdict[0] >= TRUSTED)

    def _onset(self, context: Context) -> list[float]:
        return [np.nan if self._trusted(context) else float(self.state(context).verdict[-1])]


def arrays_of(state: Any) -> list[np.ndarray]:
    """All arrays of a monitor's state, named tuples of named tuples of arrays, in the order of the Context's groups."""
    return [array for part in state for array in arrays_of(part)] if isinstance(state, tuple) else [np.asarray(state)]


def rebuilt(like: Any, arrays: Iterator[np.ndarray]) -> Any:
    """The inverse of `arrays_of`; like: a state of the same shapes."""
    if isinstance(like, tuple):
        return type(like)(*(rebuilt(part, arrays) for part in like))
    return next(arrays).reshape(np.shape(like))


class GapWatch:
    """A monitor in a closed loop (`drive.loop.watch.LoopWatch`), and what follows from what it sees.

    Args:
        policy: see `Policy`; a correction needs a car with effects as the controller's model, of any kind.
    """

    def __init__(self, monitor: Watcher, policy: Policy = "watch") -> None:
        self.monitor, self.policy = monitor, policy

    @property
    def effects_size(self) -> int:
        """Of a correction, which the controller's model takes."""
        return COUNT if self.policy in CORRECTING else 0

    def watching(
        self, builder: DiagramBuilder, ports: LoopPorts, model: StepModel | None, parameters: VehicleParameters,
        reference: Reference, steps: int, period: float,
    ) -> Watched:  # fmt: skip
        """Adds the monitor and, by the policy, the correction of the controller's model and the slow-down.

        Raises:
            ValueError: a correction of a model that takes none.
        """
        own = model.effects if isinstance(model, RememberingStepModel) else None
        if self.policy in CORRECTING and own is None:
            raise ValueError("a correction needs a car with effects as the controller's model, which takes it")
        system = builder.AddNamedSystem("monitor", GapMonitor(self.monitor))
        for name in ("measured_state", "command", "log_row"):
            builder.Connect(getattr(ports, name), system.GetInputPort(name))
        trusted = system.GetOutputPort("trusted") if self.policy == "forget" else None
        watched = Watched(ports.measured_state, ports.plan, logged_ports(system), trusted=trusted)
        posterior, corrected = system.GetOutputPort("posterior"), None
        if self.policy in CORRECTING and own is not None:
            correction = builder.AddNamedSystem("correction", GapCorrection(self.monitor, own))
            for name in ("posterior", "magnitude"):
                builder.Connect(system.GetOutputPort(name), correction.GetInputPort(name))
            builder.Connect(ports.measured_state, correction.GetInputPort("measured_state"))
            corrected = correction.GetOutputPort("correction")
            watched = watched._replace(
                measured_state=correction.GetOutputPort("corrected_state"), effects=correction.GetOutputPort("effects")
            )
        if self.policy not in SLOWING:
            return watched
        slow = SlowDown(parameters, reference, self.monitor.labels, steps, period, self.monitor.block)
        builder.AddNamedSystem("slow_down", slow)
        wires = {"plan": ports.plan, "state": ports.measured_state, "command": ports.command,
                 "reading": ports.reading, "posterior": posterior, "correction": corrected,
                 "not_judged": system.GetOutputPort("not_judged")}  # fmt: skip
        for name, port in wires.items():
            if port is not None:
                builder.Connect(port, slow.GetInputPort(name))
        logged = watched.logged | {"slow": (slow.GetOutputPort("slow"), ("slow",))}
        return watched._replace(plan=slow.GetOutputPort("paced_plan"), pace=slow.pace, logged=logged)


def logged_ports(system: GapMonitor) -> dict[str, tuple[OutputPort, Sequence[str]]]:
    """Ports and columns of a run's table."""
    return {
        "gap_posterior": (system.GetOutputPort("posterior"), [f"{PREFIX}{name}" for name in system.monitor.labels]),
        "gap_magnitude": (system.GetOutputPort("magnitude"), [f"{PREFIX}{name}" for name in FURTHER]),
        "gap_onset": (system.GetOutputPort("onset"), [f"{PREFIX}onset"]),
        "gap_not_judged": (system.GetOutputPort("not_judged"), [f"{PREFIX}{name}" for name in NOT_JUDGED]),
    }


def verdicts_of(monitor: Watcher, table: pd.DataFrame) -> Iterator[VerdictAt]:
    """What the monitor said during a run, from its table."""
    columns = [f"{PREFIX}{name}" for name in (*monitor.labels, *FURTHER, "onset")]
    rows, driving = table[columns].to_numpy(), table[[f"{PREFIX}{name}" for name in NOT_JUDGED]].to_numpy()
    judged, other = (np.any(np.diff(a, axis=0, prepend=a[:1]) != 0.0, axis=1)
                     for a in (rows[:, : len(monitor.labels)], driving))  # fmt: skip
    reported, seen = Events(), monitor.start().seen
    for i in np.flatnonzero(judged | other):
        t = float(table["t"].iloc[i])
        seen = seen._replace(time=np.concatenate([[0.0, 0.0], driving[i]]))
        reported, events = reported.after_driving(seen, harder, t)
        if judged[i]:
            reported, new = reported.after(monitor, rows[i], t)
            events += new
        yield VerdictAt(t, rows[i], events, seen)


def events_of(monitor: Watcher, table: pd.DataFrame) -> list[dict[str, Any]]:
    """The events of a run, from its table."""
    return [event for judged in verdicts_of(monitor, table) for event in judged.events]
