"""Block diagrams of Drake diagrams: named systems and ports, left to right, laid out and drawn by Graphviz.

Graphviz comes with pygraphviz's wheel: no `dot` program is needed.
"""

import dataclasses
import html
import re
from pathlib import Path
from typing import Any

from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, System

from drift_drake.errors import MissingExtraError
from drift_drake.pictures.style import INK, RESOLUTION, RUNS
from drift_drake.safe_files import replacing

Port = tuple[str, int]  # (key of a block, index of a port)
WHOLE = -1  # in place of a port's index: the block itself

FONT = "DejaVu Sans"
TITLE_SIZE, SMALL_SIZE, PORT_SIZE = 9, 6.5, 7  # [pt]
HEADER, FRAME, INSIDE = "#E4EAF1", "#8A929C", "#60605810"


@dataclasses.dataclass(frozen=True)
class _Block:
    """One leaf system; without ports in the picture (`inputs`, `outputs` empty) it is a lozenge with its name."""

    key: str
    name: str
    kind: str
    inputs: list[str]
    outputs: list[str]


@dataclasses.dataclass
class _Graph:
    blocks: dict[str, _Block] = dataclasses.field(default_factory=dict)
    frames: dict[str, tuple[str, list[str]]] = dataclasses.field(default_factory=dict)
    """Name and blocks of the diagrams within the diagram, by key; an inner one's key begins with its outer one's."""
    edges: list[tuple[Port, Port]] = dataclasses.field(default_factory=list)


def draw_graph(diagram: Diagram, stem: str | Path) -> list[Path]:
    """Writes a diagram's picture as STEM.svg and STEM.png.

    Diagrams within the diagram are opened, and framed. Ports that the outer diagram exports have blocks of their own.

    Args:
        diagram: built; its systems and ports should have names.
        stem: path of the files without their endings; the folder is made.

    Returns:
        The files' paths.

    Raises:
        MissingExtraError: pygraphviz is not installed.
    """
    layout = _laid_out(_collect(diagram))
    paths = [Path(f"{stem}{ending}") for ending in (".svg", ".png")]
    for path in paths:
        with replacing(path) as part:
            layout.draw(str(part))
    return paths


def _collect(diagram: Diagram) -> _Graph:
    graph = _Graph()
    inputs, outputs = _open(diagram, "", graph)
    for index, targets in enumerate(inputs):
        key = f"in{index}"
        name = diagram.get_input_port(index).get_name()
        graph.blocks[key] = _Block(key, name, "", [], [])
        graph.edges += [((key, WHOLE), target) for target in targets]
    for index, source in enumerate(outputs):
        key = f"out{index}"
        name = diagram.get_output_port(index).get_name()
        graph.blocks[key] = _Block(key, name, "", [], [])
        graph.edges.append((source, (key, WHOLE)))
    return graph


def _open(diagram: Diagram, prefix: str, graph: _Graph) -> tuple[list[list[Port]], list[Port]]:
    """Adds a diagram's blocks and connections; returns what its input and output ports stand for."""
    inputs: dict[int, list[list[Port]]] = {}
    outputs: dict[int, list[Port]] = {}
    systems: list[System] = diagram.GetSystems()
    for index, system in enumerate(systems):
        key = f"{prefix}s{index}"
        if isinstance(system, Diagram):
            before = set(graph.blocks)
            inputs[id(system)], outputs[id(system)] = _open(system, f"{key}_", graph)
            graph.frames[key] = (system.get_name(), [block for block in graph.blocks if block not in before])
        else:
            names_in = [system.get_input_port(k).get_name() for k in range(system.num_input_ports())]
            names_out = [system.get_output_port(k).get_name() for k in range(system.num_output_ports())]
            inputs[id(system)] = [[(key, k)] for k in range(len(names_in))]
            outputs[id(system)] = [(key, k) for k in range(len(names_out))]
            if len(names_in) == 1 and not names_out:  # a logger and the like: its name says it all
                names_in, inputs[id(system)] = [], [[(key, WHOLE)]]
            graph.blocks[key] = _Block(key, system.get_name(), _class_name(system), names_in, names_out)
    for (target, target_port), (source, source_port) in diagram.connection_map().items():
        start = outputs[id(source)][int(source_port)]
        graph.edges += [(start, end) for end in inputs[id(target)][int(target_port)]]
    exported_in = [
        [
            end
            for system, port in diagram.GetInputPortLocators(InputPortIndex(index))
            for end in inputs[id(system)][int(port)]
        ]
        for index in range(diagram.num_input_ports())
    ]
    locators = [diagram.get_output_port_locator(OutputPortIndex(index)) for index in range(diagram.num_output_ports())]
    return exported_in, [outputs[id(system)][int(port)] for system, port in locators]


def _class_name(system: System) -> str:
    """Without the scalar type that pydrake appends in letters of its own."""
    return re.split(r"[^A-Za-z0-9_]", type(system).__name__)[0].rstrip("_")


def _laid_out(graph: _Graph) -> Any:
    """The graph as pygraphviz has it, with positions."""
    try:
        import pygraphviz
    except ModuleNotFoundError:
        raise MissingExtraError("drawing a block diagram", "pygraphviz", "graph") from None
    layout = pygraphviz.AGraph(
        directed=True, strict=False, rankdir="LR", nodesep="0.22", ranksep="0.75", compound="true", dpi=RESOLUTION,
        pad="0.2",
    )  # fmt: skip
    layout.node_attr.update(fontname=FONT, fontsize=PORT_SIZE, fontcolor=INK, color=FRAME, style="rounded,filled",
                            fillcolor="white", shape="box", height="0.25", width="0.1", margin="0.11,0.03")  # fmt: skip
    layout.edge_attr.update(arrowsize="0.5")
    for block in graph.blocks.values():
        if block.inputs or block.outputs:
            layout.add_node(block.key, label=_table(block), shape="plain", style="")
        else:
            layout.add_node(block.key, label=block.name)
    framed: dict[str, Any] = {}
    for key in sorted(graph.frames, key=len):
        name, blocks = graph.frames[key]
        outer = framed.get(key.rpartition("_")[0], layout)
        framed[key] = outer.add_subgraph(
            blocks, name=f"cluster_{key}", label=f"<<b>{html.escape(name)}</b>>", labeljust="l", fontname=FONT,
            fontsize=TITLE_SIZE, fontcolor="#555555", margin="14", style="rounded,dashed,filled", color=FRAME,
            fillcolor=INSIDE,
        )  # fmt: skip
    colours = {key: RUNS[index % len(RUNS)] for index, key in enumerate(graph.blocks)}
    for number, ((source, output), (target, entry)) in enumerate(graph.edges):
        layout.add_edge(source, target, key=str(number), tailport="e" if output == WHOLE else f"y{output}:e",
                        headport="w" if entry == WHOLE else f"u{entry}:w", color=colours[source])  # fmt: skip
    layout.layout(prog="dot")
    return layout


def _table(block: _Block) -> str:
    """A block's label: its name and class over a row of ports each, inputs on the left."""

    def cell(port: str, names: list[str], row: int, align: str) -> str:
        name = html.escape(names[row]) if row < len(names) else ""
        return f'<td port="{port}{row}" align="{align}">{name}</td>'

    rows = "".join(
        f"<tr>{cell('u', block.inputs, k, 'left')}{cell('y', block.outputs, k, 'right')}</tr>"
        for k in range(max(len(block.inputs), len(block.outputs)))
    )
    return (
        f'<<table border="1" cellborder="0" cellspacing="0" cellpadding="2" style="rounded" color="{FRAME}" '
        f'bgcolor="white"><tr><td colspan="2" bgcolor="{HEADER}"><font point-size="{TITLE_SIZE}"><b>'
        f'{html.escape(block.name)}</b></font></td></tr><tr><td colspan="2" bgcolor="{HEADER}"><font '
        f'point-size="{SMALL_SIZE}" color="#666666">{html.escape(block.kind)}</font></td></tr>{rows}</table>>'
    )
