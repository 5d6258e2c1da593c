"""Block diagrams of Drake diagrams: named systems and ports, left to right.

Graphviz (which comes with pygraphviz's wheel) lays the blocks out; matplotlib draws them, so that the picture has the
same letters on every machine and needs no `dot` program.
"""

import dataclasses
import html
import re
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, Rectangle
from matplotlib.path import Path
from matplotlib.textpath import TextPath
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, System

from drift_drake.errors import MissingExtraError
from drift_drake.pictures.style import INK, RUNS, new_figure, save, styled

Array = NDArray[np.float64]
Port = tuple[str, int]  # (key of a block, index of a port)
WHOLE = -1  # in place of a port's index: the block itself

# [pt] sizes of what is drawn; the layout's unit is the point too.
TITLE_SIZE, SMALL_SIZE, PORT_SIZE = 9.0, 6.5, 7.0
HEADER_HEIGHT, ROW_HEIGHT, LOZENGE_HEIGHT, PADDING = 28.0, 13.0, 18.0, 8.0
MARGIN = 14.0
HEADER, FRAME, INSIDE = "#E4EAF1", "#8A929C", "#60605810"


@dataclasses.dataclass(frozen=True)
class _Block:
    """One leaf system; without ports in the picture (`inputs`, `outputs` empty) it is a lozenge with its name."""

    key: str
    name: str
    kind: str
    inputs: list[str]
    outputs: list[str]

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) [pt]."""
        if self.rows == 0:
            return float(np.ceil(_width(self.name, PORT_SIZE))) + 2.0 * PADDING, LOZENGE_HEIGHT
        inputs = max((_width(name, PORT_SIZE) for name in self.inputs), default=0.0)
        outputs = max((_width(name, PORT_SIZE) for name in self.outputs), default=0.0)
        gap = 14.0 if self.inputs and self.outputs else 0.0
        title = max(_width(self.name, TITLE_SIZE, "bold"), _width(self.kind, SMALL_SIZE))
        width = max(title, inputs + gap + outputs) + 2.0 * PADDING
        return float(np.ceil(width)), HEADER_HEIGHT + ROW_HEIGHT * self.rows

    @property
    def rows(self) -> int:
        return max(len(self.inputs), len(self.outputs))


@dataclasses.dataclass
class _Graph:
    blocks: dict[str, _Block] = dataclasses.field(default_factory=dict)
    frames: dict[str, tuple[str, list[str]]] = dataclasses.field(default_factory=dict)
    """Name and blocks of the diagrams within the diagram, by key; an inner one's key begins with its outer one's."""
    edges: list[tuple[Port, Port]] = dataclasses.field(default_factory=list)


def draw_graph(diagram: Diagram, stem: str | FilePath) -> list[FilePath]:
    """Writes a diagram's picture as STEM.svg and STEM.png.

    Diagrams within the diagram are opened, and framed. Ports that the outer diagram exports have blocks of their own.

    Args:
        diagram: built; its systems and ports should have names.
        stem: path of the files without their endings; the folder is made.

    Returns:
        The files' paths.
    """
    figure = graph_figure(diagram)
    stem = FilePath(stem)
    return [save(figure, stem.with_name(stem.name + ending)) for ending in (".svg", ".png")]


@styled
def graph_figure(diagram: Diagram) -> Figure:
    """The picture of `draw_graph` as a matplotlib figure."""
    graph = _collect(diagram)
    layout, framed = _lay_out(graph)
    low, high = _box(layout.graph_attr["bb"])
    width, height = high - low + 2.0 * MARGIN
    figure = new_figure(width / 72.0, height / 72.0)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(low[0] - MARGIN, high[0] + MARGIN),
                           ylim=(low[1] - MARGIN, high[1] + MARGIN))  # fmt: skip
    axes.set_axis_off()
    for key in sorted(graph.frames, key=len):
        _draw_frame(axes, graph.frames[key][0], *_box(framed[key].graph_attr["bb"]))
    colours = {key: RUNS[index % len(RUNS)] for index, key in enumerate(graph.blocks)}
    for number, (source, _) in enumerate(graph.edges):
        edge = next(edge for edge in layout.edges(keys=True) if edge[2] == str(number))
        _draw_edge(axes, layout.get_edge(*edge).attr["pos"], colours[source[0]])
    for block in graph.blocks.values():
        centre = np.array([float(part) for part in layout.get_node(block.key).attr["pos"].split(",")])
        _draw_block(axes, block, centre)
    return figure


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


def _lay_out(graph: _Graph) -> tuple[Any, dict[str, Any]]:
    """Graphviz's layout and its subgraphs by key: positions and splines as attributes [pt]."""
    try:
        import pygraphviz
    except ModuleNotFoundError:
        raise MissingExtraError("drawing a block diagram", "pygraphviz", "graph") from None
    layout = pygraphviz.AGraph(
        directed=True, strict=False, rankdir="LR", nodesep="0.22", ranksep="0.75", compound="true"
    )
    for block in graph.blocks.values():
        layout.add_node(block.key, shape="plain", label=_table(block))
    framed: dict[str, Any] = {}
    for key in sorted(graph.frames, key=len):
        outer = framed.get(key.rpartition("_")[0], layout)
        framed[key] = outer.add_subgraph(graph.frames[key][1], name=f"cluster_{key}", label=" ", margin="14")
    for number, ((source, output), (target, entry)) in enumerate(graph.edges):
        layout.add_edge(source, target, key=str(number), tailport="e" if output == WHOLE else f"y{output}:e",
                        headport="w" if entry == WHOLE else f"u{entry}:w")  # fmt: skip
    layout.layout(prog="dot")
    return layout, framed


def _table(block: _Block) -> str:
    """A block as Graphviz sees it: cells of fixed sizes, one a port; the letters are ours to draw."""
    width, height = block.size
    half = width / 2.0

    def cell(port: str, cell_width: float, height: float, span: int = 1) -> str:
        return (
            f'<td fixedsize="true" width="{cell_width:g}" height="{height:g}" colspan="{span}" '
            f'port="{html.escape(port)}"></td>'
        )

    rows = "".join(
        f"<tr>{cell(f'u{k}', half, ROW_HEIGHT)}{cell(f'y{k}', half, ROW_HEIGHT)}</tr>" for k in range(block.rows)
    )
    header = f"<tr>{cell('header', width, HEADER_HEIGHT if block.rows else height, 2)}</tr>"
    return f'<<table border="0" cellborder="0" cellspacing="0" cellpadding="0">{header}{rows}</table>>'


def _box(text: str) -> tuple[Array, Array]:
    corners = np.array([float(part) for part in text.split(",")])
    return corners[:2], corners[2:]


def _width(text: str, size: float, weight: str = "normal") -> float:
    """Of a line of text [pt]."""
    if not text:
        return 0.0
    return float(
        TextPath((0.0, 0.0), text, prop=FontProperties(family="DejaVu Sans", weight=weight, size=size))
        .get_extents()
        .width
    )


def _draw_frame(axes: Axes, name: str, low: Array, high: Array) -> None:
    axes.add_patch(
        FancyBboxPatch(tuple(low), *(high - low), boxstyle="round,pad=0,rounding_size=6", facecolor=INSIDE,
                       edgecolor=FRAME, linewidth=0.7, linestyle=(0, (4, 2)), zorder=0.5))  # fmt: skip
    axes.text(low[0] + 7.0, high[1] - 6.0, name, va="top", fontsize=TITLE_SIZE, fontweight="bold", color="#555555")


def _draw_edge(axes: Axes, position: str, colour: str) -> None:
    """Graphviz's spline 'e,x,y x,y x,y ...': the arrow's tip, then cubic Bezier points."""
    tip, *points = position.split()
    vertices = [[float(part) for part in point.split(",")] for point in points]
    vertices.append([float(part) for part in tip.removeprefix("e,").split(",")])
    codes = [Path.MOVETO, *[Path.CURVE4] * (len(points) - 1), Path.LINETO]
    axes.add_patch(
        FancyArrowPatch(path=Path(vertices, codes), arrowstyle="-|>,head_length=3.5,head_width=1.8", color=colour,
                        linewidth=1.0, joinstyle="round", shrinkA=0.0, shrinkB=0.0, zorder=1.5))  # fmt: skip


def _draw_block(axes: Axes, block: _Block, centre: Array) -> None:
    width, height = block.size
    left, bottom = centre - 0.5 * np.array([width, height])
    top = bottom + height
    rounded = "round,pad=0,rounding_size=4"
    if block.rows == 0:
        box = FancyBboxPatch((left, bottom), width, height, boxstyle="round,pad=0,rounding_size=9",
                             facecolor="white", edgecolor=FRAME, linewidth=0.8, zorder=2.0)  # fmt: skip
        axes.add_patch(box)
        axes.text(*centre, block.name, ha="center", va="center", fontsize=PORT_SIZE, color=INK, zorder=3.0)
        return
    box = FancyBboxPatch((left, bottom), width, height, boxstyle=rounded, facecolor="white", edgecolor=FRAME,
                         linewidth=0.8, zorder=2.0)  # fmt: skip
    axes.add_patch(box)
    header = Rectangle(
        (left, top - HEADER_HEIGHT), width, HEADER_HEIGHT, facecolor=HEADER, edgecolor="none", zorder=2.1
    )
    axes.add_patch(header)
    header.set_clip_path(box)
    middle = left + 0.5 * width
    axes.text(middle, top - 10.0, block.name, ha="center", va="center", fontsize=TITLE_SIZE, fontweight="bold",
              color=INK, zorder=3.0)  # fmt: skip
    axes.text(
        middle, top - 21.0, block.kind, ha="center", va="center", fontsize=SMALL_SIZE, color="#666666", zorder=3.0
    )
    for names, x, side in ((block.inputs, left + 5.0, "left"), (block.outputs, left + width - 5.0, "right")):
        for row, name in enumerate(names):
            y = top - HEADER_HEIGHT - (row + 0.5) * ROW_HEIGHT
            axes.text(x, y, name, ha=side, va="center", fontsize=PORT_SIZE, color=INK, zorder=3.0)
