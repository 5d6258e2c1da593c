"""A page runs the scripts that it was written with and no other, and loads nothing."""

import re
import subprocess

import pytest
from browser import BROWSER, needs_browser

from drift_drake.view.pages.policy import digest, with_policy

PAGE = """<!doctype html><html><head><meta charset="utf-8"><title>a</title></head><body>
<script type="text/plain">no script</script><script>document.title = "own";</script>{}</body></html>"""


def test_a_policy_names_the_pages_own_scripts():
    page = with_policy(PAGE.format(""), ["<script>1;</script>"])
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    for script in ('document.title = "own";', "1;"):
        assert f"'{digest(script)}'" in policy
    assert digest("no script") not in policy
    assert page.index("charset") < page.index("Content-Security-Policy") < page.index("<script")
    assert "unsafe-eval" not in policy


def test_a_page_without_scripts_runs_none():
    assert "script-src 'none'" in with_policy("<html><head></head><body></body></html>")


@needs_browser
@pytest.mark.parametrize(
    "injected", ["<script>document.title = 'other';</script>", "<img src=x onerror=\"document.title='other'\">"]
)
def test_a_browser_runs_no_other(tmp_path, injected):
    path = tmp_path / "page.html"
    path.write_text(with_policy(PAGE.format("")).replace("</body>", f"{injected}</body>"))
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=2000", "--dump-dom"]
    done = subprocess.run([BROWSER, *options, path.as_uri()], capture_output=True, text=True, timeout=60, check=True)
    assert "<title>own</title>" in done.stdout
