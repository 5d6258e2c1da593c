"""A page in a headless browser: what it says on the console, what it has drawn, whether anything is cut or overlaps."""

import html
import json
import re
import shutil
import subprocess

import pytest

from drift_drake.view.pages.policy import SCRIPT, digest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
WIDTHS = (1280, 390)  # [px] of a desktop's window and of a phone's
MEASURE = """<script>setTimeout(() => {
  const drawn = (chart, what) => chart.querySelectorAll(what).length;
  const shown = text => text.textContent.trim() && text.getBoundingClientRect().width > 0;
  const within = (a, b) =>
    a.left > b.left - 1 && a.right < b.right + 1 && a.top > b.top - 1 && a.bottom < b.bottom + 1;
  const wide = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left);
  const high = (a, b) => Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
  const cut = [], overlaps = [];
  const charts = [...document.querySelectorAll(".chart")].map(chart => {
    const box = chart.getBoundingClientRect();
    const texts = [...chart.querySelectorAll("text")].filter(shown);
    const boxes = texts.map(text => [text.textContent.trim(), text.getBoundingClientRect()]);
    for (const [i, [text, a]] of boxes.entries()) {
      if (!within(a, box)) cut.push(text);
      for (const [other, b] of boxes.slice(i + 1))
        if (wide(a, b) > 2 && high(a, b) > 3) overlaps.push(text + " | " + other);
    }
    const legend = chart.querySelector("g.legend"), buttons = chart.querySelector(".modebar-group");
    if (legend && buttons) {
      const [a, b] = [legend.getBoundingClientRect(), buttons.getBoundingClientRect()];
      if (wide(a, b) > 0 && high(a, b) > 0) overlaps.push("legend | buttons");
    }
    return { axes: new Set([...chart.querySelectorAll("g.subplot")].map(axes => axes.classList[1])).size,
             drawn: drawn(chart, "g.trace.scatter") + drawn(chart, ".hm") };
  });
  const tooWide = document.documentElement.scrollWidth - innerWidth;
  parent.postMessage({ width: innerWidth, charts, cut, overlaps, tooWide }, "*");
}, 1500)</script></body>"""
FRAMES = """<!doctype html><body style="margin: 0"><script>
const pages = [];
addEventListener("message", event => { pages.push(event.data); document.title = JSON.stringify(pages); });
</script>"""
# In frames: a headless window has 500 px at least.
FRAME = '<iframe style="border: 0; display: block" width="{}" height="900" src="{}.html"></iframe>'

needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine: apt install chromium")


def opened(*paths):
    """What pages look like at each of `WIDTHS`, and their console."""
    folder = paths[0].parent / "opened"
    folder.mkdir(exist_ok=True)
    for k, path in enumerate(paths):
        measure = SCRIPT.search(MEASURE)["text"]
        page = path.read_text(encoding="utf-8").replace("</body>", MEASURE)
        # The page's policy lets it run.
        page = page.replace("script-src 'none'", "script-src", 1)
        page = page.replace("script-src", f"script-src '{digest(measure)}'", 1)
        (folder / f"{k}.html").write_text(page, encoding="utf-8")
    frames = FRAMES + "".join(FRAME.format(width, k) for k in range(len(paths)) for width in WIDTHS)
    (folder / "frames.html").write_text(frames, encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=8000", "--enable-logging=stderr"]
    done = subprocess.run(
        [BROWSER, *options, "--window-size=1400,2000", "--dump-dom", (folder / "frames.html").as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    pages = json.loads(html.unescape(re.search(r"<title>(.*?)</title>", done.stdout)[1]))
    assert sorted(page["width"] for page in pages) == sorted(len(paths) * WIDTHS)
    return pages, console


def check_charts(*paths):
    """Every chart of the pages is drawn, no text of it is cut or covered, nothing is on the console or sticks out."""
    pages, console = opened(*paths)
    assert console == []
    for page in pages:
        assert page["tooWide"] <= 0
        assert page["cut"] == []
        assert page["overlaps"] == [], page["overlaps"][:6]
        assert page["charts"]
        for chart in page["charts"]:
            assert 1 <= chart["axes"] <= chart["drawn"]


NAMELESS = """[...document.querySelectorAll("a[href], button, input, select, summary, textarea, [tabindex]")]
  .filter(e => !e.closest("[inert]") && !(e.ariaLabel || e.textContent.trim() || e.labels?.length))
  .map(e => e.outerHTML)"""
DARK = """Math.max(...getComputedStyle(document.documentElement).backgroundColor.match(/\\d+/g).map(Number)) < 90"""


RESIZED = 300  # [ms] that a page has after its window has been resized


def check_looks(browser, *paths, wait=500):
    """Pages in both schemes and widths: dark where asked, no overflow, names for what has the focus, nothing loaded.

    Args:
        browser: the fixture; wait: for scripts [ms].
    """
    for path in paths:
        for scheme in ("light", "dark"):
            page = browser.new_page(viewport={"width": WIDTHS[0], "height": 900}, color_scheme=scheme)
            wrong = []
            page.on("console", lambda m, to=wrong: to.append(m.text) if m.type == "error" else None)
            page.on("pageerror", lambda error, to=wrong: to.append(str(error)))
            page.on("request", lambda r, to=wrong: to.append(r.url) if r.url.startswith(("http", "ws")) else None)
            page.goto(path.as_uri())
            page.wait_for_timeout(wait)
            assert page.evaluate("document.documentElement.lang") == "en"
            assert page.evaluate(DARK) == (scheme == "dark")
            for width in WIDTHS:  # loaded once: charts take long
                page.set_viewport_size({"width": width, "height": 900})
                page.wait_for_timeout(RESIZED)
                assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
                assert page.evaluate(NAMELESS) == []
            assert wrong == []
            page.close()
