"""Signals joined and taken apart by their names, by a system of Drake's own, which calls no Python for it."""

from collections.abc import Mapping, Sequence

from pydrake.systems.primitives import Selector, SelectorParams

Ports = Mapping[str, Sequence[str]]


def select_signals(inputs: Ports, outputs: Ports) -> Selector:
    """A system whose output ports give signals of its input ports.

    Args:
        inputs, outputs: names of the signals of each port, in order, by the port's name.

    Raises:
        ValueError: an output asks for a signal that no input has.
    """
    places = {signal: (i, k) for i, names in enumerate(inputs.values()) for k, signal in enumerate(names)}
    unknown = {signal for names in outputs.values() for signal in names} - set(places)
    if unknown:
        raise ValueError(f"no input has the signal {', '.join(sorted(unknown))}; there are {', '.join(places)}")
    return Selector(
        SelectorParams(
            inputs=[SelectorParams.InputPortParams(name=name, size=len(names)) for name, names in inputs.items()],
            outputs=[
                SelectorParams.OutputPortParams(name=name, selections=[_selection(*places[s]) for s in names])
                for name, names in outputs.items()
            ],
        )
    )


def _selection(port: int, offset: int) -> SelectorParams.OutputSelection:
    return SelectorParams.OutputSelection(input_port_index=port, input_offset=offset)
