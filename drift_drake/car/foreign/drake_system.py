"""A Drake System as a simulator: ports by name, states set from what is measured."""

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from drift_drake.car.foreign.rollouts import SimulatorError
from drift_drake.common.arrays import Array
from drift_drake.common.errors import one_line

ELEMENT = re.compile(r"(.+)\[(\d+)\]")  # of a port, or of a state: continuous[3]
STATES = ("continuous", "discrete")


class DrakeSystem:
    """What `make(**parameters)` builds, in one Simulator that starts anew for each roll-out.

    An input or output is a port's name, or PORT[i] where it is one of several numbers. A start value is
    `continuous[i]` or `discrete[i]`, unless a function `set_state(system, context, start)` sets it.
    """

    def __init__(self, make: Callable[..., Any], set_state: Callable[..., Any] | None) -> None:
        self._make, self._set_state = make, set_state
        self._of: tuple[float, ...] | None = None  # parameters of the system that there is

    def _build(self, parameters: Mapping[str, float]) -> None:
        from pydrake.systems.analysis import Simulator
        from pydrake.systems.framework import System

        self._of = None
        try:
            self._system = self._make(**parameters)
        except Exception as error:  # of any class that a user's code raises
            raise SimulatorError(
                f"it cannot be made with these parameters ({type(error).__name__}: {one_line(error)})"
            ) from None
        if not isinstance(self._system, System):
            raise SimulatorError(f"its function returned {type(self._system).__name__}, no Drake System")
        self._simulator = Simulator(self._system)
        self._context = self._simulator.get_mutable_context()
        self._of = tuple(parameters.values())

    def roll(self, start: Mapping[str, Any], held: Mapping[str, Array], inputs: Mapping[str, Array], dt: float,
             outputs: tuple[str, ...], parameters: Mapping[str, float]) -> Mapping[str, Any]:  # fmt: skip
        if self._of != tuple(parameters.values()):
            self._build(parameters)
        rows = len(next(iter(inputs.values())))
        self._system.SetDefaultContext(self._context)
        self._context.SetTime(0.0)
        fixed = self._fixed(inputs)
        readers = {name: self._reader(name) for name in outputs}
        out = {name: np.empty(rows) for name in outputs}
        lead = len(next(iter(held.values()))) if held else 1
        for row in range(rows):
            for port, values in fixed.items():
                # A row's inputs hold until the next: their mean, to second order in dt.
                port.FixValue(self._context, values[min(row, rows - 1)])
            if row < lead:
                self._begin({name: values[row] for name, values in held.items()} if held else start)
            if row == 0:
                self._simulator.Initialize()
            for name, read in readers.items():
                out[name][row] = read()
            if row < rows - 1:
                self._simulator.AdvanceTo((row + 1) * dt)
        return out

    def _fixed(self, inputs: Mapping[str, Array]) -> dict[Any, Array]:
        """Input ports and their values [rows, size], each the mean of a row and the next; ports not named are zero."""
        out: dict[Any, Array] = {}
        rows = len(next(iter(inputs.values())))
        ports = {self._system.get_input_port(i).get_name(): self._system.get_input_port(i)
                 for i in range(self._system.num_input_ports())}  # fmt: skip
        values = {name: np.zeros((rows, port.size())) for name, port in ports.items()}
        for name, own in inputs.items():
            port, element = _split(name)
            if port not in ports or element >= ports[port].size():
                raise SimulatorError(f"has no input port {name}; it has {', '.join(ports) or 'none'}")
            values[port][:, element] = np.concatenate([0.5 * (own[1:] + own[:-1]), own[-1:]])
        for name, port in ports.items():
            out[port] = values[name]
        return out

    def _reader(self, name: str) -> Callable[[], float]:
        port, element = _split(name)
        try:
            found = self._system.GetOutputPort(port)
        except RuntimeError:
            names = [self._system.get_output_port(i).get_name() for i in range(self._system.num_output_ports())]
            raise SimulatorError(f"has no output port {port}; it has {', '.join(names) or 'none'}") from None
        if element >= found.size():
            raise SimulatorError(f"output port {port} has {found.size()} numbers, and none at {element}")
        return lambda: float(found.Eval(self._context)[element])

    def _begin(self, start: Mapping[str, Any]) -> None:
        """Sets what is measured of the state, the rest of it as it is."""
        if self._set_state is not None:
            self._set_state(self._system, self._context, {name: float(value) for name, value in start.items()})
            return
        for name, value in start.items():
            kind, element = _split(name)
            if kind not in STATES:
                raise SimulatorError(
                    f"start value {name} is no state; give continuous[i] or discrete[i], or set_state: MODULE:FUNCTION"
                )
            try:
                if kind == "continuous":
                    vector = self._context.get_mutable_continuous_state_vector()
                else:
                    vector = self._context.get_mutable_discrete_state_vector()
                vector.SetAtIndex(element, float(value))
            except (RuntimeError, IndexError, SystemExit) as error:
                raise SimulatorError(f"state {name} cannot be set ({one_line(error)})") from None


def _split(name: str) -> tuple[str, int]:
    """A port's or state's name and the element."""
    found = ELEMENT.fullmatch(name)
    return (found[1], int(found[2])) if found else (name, 0)
