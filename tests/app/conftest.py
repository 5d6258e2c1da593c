"""The workbench on a folder, and a browser that notes errors and requests to anywhere else."""

import json
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

WAIT = 90.0  # [s]


FLAWS = """() => {
  const root = document.documentElement, found = root.lang ? [] : ["no lang"];
  if (root.scrollWidth > innerWidth) found.push(`${root.scrollWidth - innerWidth} px too wide`);
  for (const e of document.querySelectorAll("button, a[href], input, select, textarea, summary, iframe, [tabindex]"))
    if (e.tabIndex >= 0 && !e.closest("[inert]") &&
        !(e.getAttribute("aria-label") || e.title || e.textContent.trim() || e.labels?.length))
      found.push(`nameless: ${e.outerHTML.slice(0, 100)}`);
  for (const e of document.querySelectorAll("main *, header *"))
    if (!e.children.length && e.getClientRects().length && e.getBoundingClientRect().right > innerWidth + 1 &&
        !e.closest(".wide, svg, .js-plotly-plot, .skip"))
      found.push(`sticks out: ${e.outerHTML.slice(0, 100)}`);
  return found;
}"""


class Workbench:
    """`drift-drake app` in a process of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder, given = folder, folder.parent / f"{folder.name}.json"
        given.unlink(missing_ok=True)  # of a workbench before
        path = [entry for entry in sys.path if entry]
        program = f"import sys; sys.path[:] = {path!r}; from drift_drake.__main__ import main; sys.exit(main())"
        words = ["app", str(folder), "--no-open", "--json", str(given)]
        self.log = given.with_suffix(".log").open("wb")
        self.process = subprocess.Popen([sys.executable, "-c", program, *words], stdout=self.log, stderr=self.log)
        end = time.monotonic() + WAIT
        while not given.exists() and self.process.poll() is None and time.monotonic() < end:
            time.sleep(0.05)
        assert given.exists(), Path(self.log.name).read_text()
        self.address = json.loads(given.read_text())["address"]
        self.site = self.address.split("/?")[0]

    def close(self) -> None:
        """Ends it as Ctrl-C does."""
        self.process.terminate()
        self.process.wait(WAIT)
        self.log.close()


class Window:
    """A window of the browser on a workbench."""

    def __init__(self, browser, workbench, width=1280, scheme="light", height=900, scale=1.0) -> None:
        self.context = browser.new_context(
            viewport={"width": width, "height": height}, color_scheme=scheme, device_scale_factor=scale
        )
        self.page = self.context.new_page()
        self.page.set_default_timeout(1000.0 * WAIT)
        self.workbench, self.folder, self.site, self.wrong = workbench, workbench.folder, workbench.site, []
        self.page.on("console", lambda m: self.wrong.append(f"{m.text} {m.location}") if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self._asked(request.url))
        self.page.goto(workbench.address)

    def _asked(self, url: str) -> None:
        if not re.match(rf"({re.escape(self.site)}/|ws://{self.site[7:]}/|data:|blob:)", url):
            self.wrong.append(f"asks {url}")

    def go(self, step: str) -> None:
        """To a step's page, by its link."""
        self.page.get_by_role("navigation").get_by_role("link", name=f"{step}:").click()
        self.page.get_by_role("heading", name=step, level=1).wait_for()

    def flaws(self) -> list[str]:
        """What does not fit the window, and what a keyboard reaches and a screen reader cannot name."""
        return self.page.evaluate(FLAWS)


@pytest.fixture
def window(browser):
    """Makes windows, which are closed in the end; nothing may be wrong in any."""
    pytest.importorskip("nicegui", reason="the workbench needs the extra `app`")
    opened = []

    def new(workbench, **options):
        opened.append(Window(browser, workbench, **options))
        return opened[-1]

    yield new
    for one in opened:
        assert one.wrong == []
        one.context.close()
