"""What a reader copies from a page's console block in a real browser: commands, without prompts and answers."""

import functools
import http.server
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
PAGE = """# A page

```console
$ drift-drake init car.yaml
wrote car.yaml
$ drift-drake check logs \\
    --vehicle car.yaml
```
"""
COMMANDS = ["drift-drake init car.yaml", "drift-drake check logs \\", "    --vehicle car.yaml"]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The address of a site of one page, with the theme, style and extensions of the documentation's."""
    pytest.importorskip("material", reason="the site is an extra: pip install 'drift_drake[docs]'")
    folder = tmp_path_factory.mktemp("site")
    (folder / "docs").mkdir()
    (folder / "docs" / "index.md").write_text(PAGE)
    (folder / "docs" / "site.css").write_text((ROOT / "docs" / "site.css").read_text())
    own = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
    kept = {name: own[name] for name in ("site_name", "theme", "extra_css", "markdown_extensions")}
    (folder / "mkdocs.yml").write_text(yaml.safe_dump(kept | {"plugins": []}))
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", "out"]
    subprocess.run(command, cwd=folder, check=True, timeout=300, capture_output=True)
    handler = functools.partial(Quiet, directory=folder / "out")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_) -> None:
        """Says nothing."""


def copied(page):
    return page.evaluate("navigator.clipboard.readText()")


def test_prompts_and_answers_are_not_copied(site, browser):
    context = browser.new_context(permissions=["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto(site)
    page.locator("pre").hover()
    page.get_by_role("button", name="Copy to clipboard").click()
    page.wait_for_function("navigator.clipboard.readText().then(text => text !== '')")
    assert [line for line in copied(page).split("\n") if line] == COMMANDS
    page.evaluate("getSelection().selectAllChildren(document.querySelector('pre code'))")
    page.keyboard.press("Control+C")
    assert "$" not in copied(page)
    assert "wrote car.yaml" in copied(page)  # what is selected by hand is copied, but for prompts
    context.close()
