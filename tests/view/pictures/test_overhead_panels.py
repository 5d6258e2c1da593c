"""Groups of runs from above."""

import pandas as pd
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.reference.trajectory import Reference
from experiments.pictures.overhead_panels import OverheadPanel, overhead_panels


def test_a_panel_a_group_with_marks_where_runs_ended(perfect_run: pd.DataFrame, eight: Reference) -> None:
    panels = [
        OverheadPanel("lost: 0 of 2", [perfect_run, perfect_run.iloc[:200]], ["left the lane", "spin"], perfect_run),
        OverheadPanel("held: 1 of 1", [perfect_run], ["completed"], perfect_run),
        OverheadPanel("a third", [perfect_run], ["completed"], perfect_run),
    ]
    figure = overhead_panels(panels, eight, VehicleParameters())
    visible = [axes for axes in figure.axes if axes.get_visible()]
    assert [axes.get_title(loc="left") for axes in visible] == [panel.title for panel in panels]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["median run", "all runs", "reference", "spin", "left the lane"]


def test_no_panel_is_refused(eight: Reference) -> None:
    with pytest.raises(ValueError, match="no runs to draw"):
        overhead_panels([], eight, VehicleParameters())
