"""The demo: the log that it ships with, and the page."""

import base64
import gzip
import json
import re

import pytest

from drift_drake.car.log.table import OPTIONAL, read_case, run_paths
from experiments.demo import MODELS, DemoConfig, main
from experiments.demo_log import FOLDER, TRUTH
from experiments.demo_page import embedded


def test_the_shipped_log_is_small_whole_and_does_not_tell():
    runs = read_case(FOLDER)
    assert [run.name for run in runs] == ["run_0", "run_1", "run_2", "run_3"]
    assert all(run.column(name) is not None for run in runs for name in OPTIONAL)
    assert sum(path.stat().st_size for path in run_paths(FOLDER)) < 250_000
    assert set(json.loads((FOLDER / TRUTH).read_text())) == {"effects", "strange", "deviations"}


def test_a_file_is_embedded_whole():
    assert gzip.decompress(base64.b64decode(embedded("<p>page</p>"))) == b"<p>page</p>"


@pytest.mark.slow
def test_the_page_has_all_and_loads_nothing(tmp_path, capsys):
    main(DemoConfig(out=tmp_path, workers=1))
    assert f"the page: {tmp_path / 'index.html'}" in capsys.readouterr().out
    page = (tmp_path / "index.html").read_text()
    assert not re.search(r"""(src|href)=["']?https?:""", page)
    numbers = json.loads((tmp_path / "numbers.json").read_text())
    assert set(numbers["figure_8"]) == set(MODELS)
    for name in ("Once-OCP", "Twice-Info", "oracle", "run_", "What the log hides"):
        assert name in page
    # The truth stands in the last section alone.
    (name,) = numbers["truth"]["effects"]
    value = f"{numbers['truth']['effects'][name]:.4g}"
    assert value in page[page.index("What the log hides") :]
