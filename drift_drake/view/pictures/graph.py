"""Block diagrams of Drake diagrams: named systems and ports, left to right, laid out and drawn by Graphviz.

Graphviz comes with pygraphviz's wheel: no `dot` program is needed.
"""

import dataclasses
import html
import re
from pathlib import Path
from typing import Any

from PIL import Image
from PIL.PngImagePlugin import PngInfo
from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, System

from drift_drake.common.errors import MissingExtraError
from drift_drake.common.safe_files import replacing
from drift_drake.view.colours import INK, RUNS
from drift_drake.view.style import RESOLUTION

Port = tuple[str, int]  # (key of a block, index of a port)
LOGGER = "VectorLogSink"
CONNECTIONS = "connections"  # name of a PNG's text
DEEPEST = 99  # of diagrams within one another: all are opened
WHOLE = -1  # in place of a port's index: the block itself

FONT = "DejaVu Sans"
TITLE_SIZE, SMALL_SIZE, PORT_SIZE = 11, 8, 9  # [pt]
HEADER, FRAME, INSIDE, MUTED = "#E4EAF1", "#8A929C", "#60605810", "#666666"


@dataclasses.dataclass(frozen=True)
class _Block:
    """One leaf system; without ports in the picture (`inputs`, `outputs` empty) it is a lozenge with its name."""

    key: str
    name: str
    kind: str
    inputs: list[str]
    outputs: list[str]
    logs: dict[int, str] = dataclasses.field(default_factory=dict)
    """Name of the logger of each output port that has one: it stands at the port, without a block of its own."""


@dataclasses.dataclass
class _Graph:
    blocks: dict[str, _Block] = dataclasses.field(default_factory=dict)
    frames: dict[str, tuple[str, list[str]]] = dataclasses.field(default_factory=dict)
    """Name and blocks of the diagrams within the diagram, by key; an inner one's key begins with its outer one's."""
    edges: list[tuple[Port, Port]] = dataclasses.field(default_factory=list)


def draw_graph(diagram: Diagram, stem: str | Path, depth: int = DEEPEST) -> list[Path]:
    """Writes a diagram's picture as STEM.svg and STEM.png, whose text CONNECTIONS says what it shows.

    Diagrams within the diagram are opened, and framed. Ports that the outer diagram exports have blocks of their own.

    Args:
        diagram: built; its systems and ports should have names.
        stem: path of the files without their endings; the folder is made.
        depth: how many diagrams within one another are opened; those below are blocks like other systems.

    Returns:
        The files' paths.

    Raises:
        MissingExtraError: pygraphviz is not installed.
    """
    graph = _with_loggers_at_ports(_collect(diagram, depth))
    layout = _laid_out(graph)
    paths = [Path(f"{stem}{ending}") for ending in (".svg", ".png")]
    for path in paths:
        with replacing(path) as part:
            layout.draw(str(part))
            if path.suffix == ".png":
                _add_text(part, _connections(graph))
    return paths


def connections_shown(picture: Path) -> list[str]:
    """What a PNG of `draw_graph` shows: its connections and loggers, sorted; whether it is out of date shows in them.

    Raises:
        OSError, KeyError: it is no such picture.
    """
    with Image.open(picture) as image:
        return str(image.info[CONNECTIONS]).splitlines()


def _connections(graph: _Graph) -> list[str]:
    def end(key: str, port: int, names: list[str]) -> str:
        return graph.blocks[key].name if port == WHOLE else f"{graph.blocks[key].name}.{names[port]}"

    lines = [
        f"{end(source, output, graph.blocks[source].outputs)} -> {end(target, entry, graph.blocks[target].inputs)}"
        for (source, output), (target, entry) in graph.edges
    ]
    blocks = graph.blocks.values()
    return sorted(lines + [f"{b.name}.{b.outputs[port]} -> {log}" for b in blocks for port, log in b.logs.items()])


def _add_text(picture: Path, lines: list[str]) -> None:
    text = PngInfo()
    text.add_text(CONNECTIONS, "\n".join(lines))
    with Image.open(picture) as image:
        image.load()
    image.save(picture, format="PNG", pnginfo=text, dpi=(RESOLUTION, RESOLUTION), optimize=True)


def _collect(diagram: Diagram, depth: int) -> _Graph:
    graph = _Graph()
    inputs, outputs = _open(diagram, "", graph, depth)
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


def _open(diagram: Diagram, prefix: str, graph: _Graph, depth: int) -> tuple[list[list[Port]], list[Port]]:
    """Adds a diagram's blocks and connections; returns what its input and output ports stand for."""
    inputs: dict[int, list[list[Port]]] = {}
    outputs: dict[int, list[Port]] = {}
    systems: list[System] = diagram.GetSystems()
    for index, system in enumerate(systems):
        key = f"{prefix}s{index}"
        if isinstance(system, Diagram) and depth > 0:
            before = set(graph.blocks)
            inputs[id(system)], outputs[id(system)] = _open(system, f"{key}_", graph, depth - 1)
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


def _with_loggers_at_ports(graph: _Graph) -> _Graph:
    """The graph with each logger's name at the port that it logs, in place of a block and a connection."""
    for (source, output), (target, entry) in list(graph.edges):
        if graph.blocks[target].kind == LOGGER and output != WHOLE:
            logs = graph.blocks[source].logs
            logs[output] = ", ".join(filter(None, [logs.get(output), graph.blocks[target].name]))
            graph.edges.remove(((source, output), (target, entry)))
            del graph.blocks[target]
    return graph


def reading_order(graph: _Graph) -> list[str]:
    """Blocks from left to right with few connections against it (the heuristic of Eades, Lin and Smyth, 1993)."""
    left, begun, ended = list(graph.blocks), list[str](), list[str]()
    while left:
        ins, outs = dict.fromkeys(left, 0), dict.fromkeys(left, 0)
        for (source, _), (target, _) in graph.edges:
            if source in ins and target in ins and source != target:
                outs[source], ins[target] = outs[source] + 1, ins[target] + 1
        sink = next((key for key in reversed(left) if not outs[key]), None)
        chosen = max(left, key=lambda key: (not ins[key], outs[key] - ins[key])) if sink is None else sink
        left.remove(chosen)
        if sink is None:
            begun.append(chosen)
        else:
            ended.append(chosen)
    return begun + ended[::-1]


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
        directed=True, strict=False, rankdir="LR", nodesep="0.22", ranksep="0.55", compound="true", dpi=RESOLUTION,
        pad="0.2",
    )  # fmt: skip
    layout.node_attr.update(fontname=FONT, fontsize=PORT_SIZE, fontcolor=INK, color=FRAME, style="rounded,filled",
                            fillcolor="white", shape="box", height="0.25", width="0.1", margin="0.11,0.03")  # fmt: skip
    layout.edge_attr.update(arrowsize="0.5")
    place = {key: k for k, key in enumerate(reading_order(graph))}
    for block in sorted(graph.blocks.values(), key=lambda block: place[block.key]):
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
        begin, end = "e" if output == WHOLE else f"y{output}:e", "w" if entry == WHOLE else f"u{entry}:w"
        if place[source] < place[target]:
            layout.add_edge(source, target, key=str(number), tailport=begin, headport=end, color=colours[source])
        else:  # against the reading order: turned round for the layout, which so has no loops to break
            layout.add_edge(target, source, key=str(number), tailport=end, headport=begin, dir="back",
                            color=colours[source])  # fmt: skip
    layout.layout(prog="dot")
    return layout


def _table(block: _Block) -> str:
    """A block's label: its name and class over a row of ports each, inputs on the left, loggers below what they log."""

    def cell(port: str, names: list[str], row: int, align: str, log: str = "") -> str:
        name = html.escape(names[row]) if row < len(names) else ""
        below = f'<br/>{_small(log)}<br align="right"/>' if log else ""
        return f'<td port="{port}{row}" align="{align}" balign="{align}">{name}{below}</td>'

    rows = "".join(
        f"<tr>{cell('u', block.inputs, k, 'left')}{cell('y', block.outputs, k, 'right', block.logs.get(k, ''))}</tr>"
        for k in range(max(len(block.inputs), len(block.outputs)))
    )
    return (
        f'<<table border="1" cellborder="0" cellspacing="0" cellpadding="2" style="rounded" color="{FRAME}" '
        f'bgcolor="white"><tr><td colspan="2" bgcolor="{HEADER}"><font point-size="{TITLE_SIZE}"><b>'
        f'{html.escape(block.name)}</b></font></td></tr><tr><td colspan="2" bgcolor="{HEADER}">{_small(block.kind)}'
        f"</td></tr>{rows}</table>>"
    )


def _small(text: str) -> str:
    return f'<font point-size="{SMALL_SIZE}" color="{MUTED}">{html.escape(text)}</font>'
