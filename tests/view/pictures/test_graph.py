"""Block diagrams hold every system, port and connection of a diagram, in nested frames."""

import re
from itertools import pairwise
from xml.etree import ElementTree

import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, Gain, Integrator, LogVectorOutput

from drift_drake.view.pictures.graph import connections_shown, draw_graph

SVG = "{http://www.w3.org/2000/svg}"


def inner():
    builder = DiagramBuilder()
    gain = builder.AddNamedSystem("stiffness", Gain(2.0, 2))
    adder = builder.AddNamedSystem("balance", Adder(2, 2))
    builder.Connect(gain.get_output_port(), adder.get_input_port(0))
    builder.ExportInput(gain.get_input_port(), "position")
    builder.ExportInput(adder.get_input_port(1), "force")
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
    builder.ExportInput(spring.GetInputPort("force"), "wind")
    builder.ExportOutput(integrator.get_output_port(), "motion")
    diagram = builder.Build()
    diagram.set_name("loop")
    return diagram


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return draw_graph(closed_loop(), tmp_path_factory.mktemp("graphs") / "deeper" / "loop")


@pytest.fixture(scope="module")
def picture(files):
    return ElementTree.parse(files[0])


def texts(picture):
    """Where each text of the picture stands."""
    return {text.text: (float(text.get("x")), float(text.get("y"))) for text in picture.iter(f"{SVG}text")}


def groups(picture, kind):
    return [group for group in picture.iter(f"{SVG}g") if group.get("class") == kind]


def test_every_system_port_and_connection_is_drawn(picture):
    drawn = texts(picture)
    for name in ("stiffness", "balance", "mass", "spring", "log_motion", "wind", "motion", "Gain", "Integrator", "sum"):
        assert name in drawn
    # stiffness-balance, balance-mass, mass-stiffness, wind-balance, mass-motion.
    assert len(groups(picture, "edge")) == 5


def test_a_logger_stands_at_the_port_that_it_logs(picture):
    drawn = texts(picture)
    assert "VectorLogSink" not in drawn  # a logger's name says it all
    (x, y), (port_x, port_y) = drawn["log_motion"], drawn["y0"]
    assert abs(x - port_x) < 40
    assert 0 < y - port_y < 15
    assert drawn["mass"][1] < port_y


def test_a_png_says_what_it_shows(files):
    assert connections_shown(files[1]) == [
        "balance.sum -> mass.u0", "mass.y0 -> log_motion", "mass.y0 -> motion", "mass.y0 -> stiffness.u0",
        "stiffness.y0 -> balance.u0", "wind -> balance.u1",
    ]  # fmt: skip


def test_connections_run_from_left_to_right_but_for_one_of_a_loop(picture):
    """Of stiffness, balance and mass, one connection goes back."""
    where = texts(picture)
    loop = [where[name][0] for name in ("stiffness", "balance", "mass", "stiffness")]
    assert sum(end < begin for begin, end in pairwise(loop)) == 1


def test_a_diagram_within_that_is_not_opened_is_one_block(tmp_path):
    _, png = draw_graph(closed_loop(), tmp_path / "closed", depth=0)
    assert "spring.force -> mass.u0" in connections_shown(png)


def test_the_inside_of_a_frame_lies_inside_and_the_rest_outside(picture):
    where = texts(picture)
    (frame,) = groups(picture, "cluster")
    corners = re.findall(r"(-?[\d.]+),(-?[\d.]+)", frame.find(f"{SVG}path").get("d"))
    x, y = zip(*((float(a), float(b)) for a, b in corners), strict=True)

    def inside(name):
        return min(x) < where[name][0] < max(x) and min(y) < where[name][1] < max(y)

    assert all(map(inside, ("stiffness", "balance", "spring")))
    assert not any(map(inside, ("mass", "wind", "log_motion")))


def test_svg_and_png_are_written(files):
    assert [file.name for file in files] == ["loop.svg", "loop.png"]
    assert files[0].read_text().lstrip().startswith("<?xml")
    assert files[1].read_bytes().startswith(b"\x89PNG")
    assert all(file.stat().st_size > 5_000 for file in files)
