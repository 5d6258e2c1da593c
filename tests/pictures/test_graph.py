"""Block diagrams hold every system, port and connection of a diagram, in nested frames."""

from matplotlib.patches import FancyArrowPatch
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, Gain, Integrator, LogVectorOutput

from drift_drake.pictures.graph import draw_graph, graph_figure


def inner():
    builder = DiagramBuilder()
    gain = builder.AddNamedSystem("stiffness", Gain(2.0, 2))
    adder = builder.AddNamedSystem("balance", Adder(2, 2))
    builder.Connect(gain.get_output_port(), adder.get_input_port(0))
    builder.ExportInput(gain.get_input_port(), "position")
    builder.ExportInput(adder.get_input_port(1), "push")
    builder.ExportOutput(adder.get_output_port(), "force")
    diagram = builder.Build()
    diagram.set_name("spring")
    return diagram


def closed_loop():
    builder = DiagramBuilder()
    spring = builder.AddSystem(inner())
    integrator = builder.AddNamedSystem("mass", Integrator(2))
    builder.Connect(spring.GetOutputPort("force"), integrator.get_input_port())
    builder.Connect(integrator.get_output_port(), spring.GetInputPort("position"))
    LogVectorOutput(integrator.get_output_port(), builder).set_name("log_motion")
    builder.ExportInput(spring.GetInputPort("push"), "wind")
    builder.ExportOutput(integrator.get_output_port(), "motion")
    diagram = builder.Build()
    diagram.set_name("loop")
    return diagram


def test_every_system_port_and_connection_is_drawn():
    axes = graph_figure(closed_loop()).axes[0]
    texts = [text.get_text() for text in axes.texts]
    for name in ("stiffness", "balance", "mass", "spring", "log_motion", "wind", "motion", "Gain", "Integrator", "sum"):
        assert name in texts
    # stiffness-balance, balance-mass, mass-stiffness, mass-log, wind-balance, mass-motion.
    assert sum(isinstance(patch, FancyArrowPatch) for patch in axes.patches) == 6
    assert "VectorLogSink" not in texts  # a logger's name says it all


def test_the_inside_of_a_frame_lies_inside_and_the_rest_outside():
    axes = graph_figure(closed_loop()).axes[0]
    where = {text.get_text(): text.get_position() for text in axes.texts}
    frame = axes.patches[0].get_bbox()
    assert all(frame.contains(*where[name]) for name in ("stiffness", "balance", "spring"))
    assert not any(frame.contains(*where[name]) for name in ("mass", "wind", "log_motion"))


def test_svg_and_png_are_written(tmp_path):
    files = draw_graph(closed_loop(), tmp_path / "graphs" / "loop")
    assert [file.name for file in files] == ["loop.svg", "loop.png"]
    assert files[0].read_text().lstrip().startswith("<?xml")
    assert files[1].read_bytes().startswith(b"\x89PNG")
    assert all(file.stat().st_size > 5_000 for file in files)
