"""The documentation's picture of the closed loop is that of today's diagram."""

from pathlib import Path

import pytest

from diagrams.docs_picture import PICTURE, main
from drift_drake.view.pictures.graph import connections_shown

pytest.importorskip("pygraphviz", reason="pictures of diagrams are an extra: pip install 'drift_drake[graph]'")


def test_the_picture_of_the_closed_loop_is_not_out_of_date(tmp_path: Path) -> None:
    main(tmp_path / "drawn.png")
    drawn = connections_shown(tmp_path / "drawn.png")
    assert "adapter.parameters -> controller.theta" in drawn
    assert "actuator.command -> log_command" in drawn
    assert connections_shown(PICTURE) == drawn, "docs/closed_loop.png is out of date: run `make pictures`"
