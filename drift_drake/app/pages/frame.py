"""What all pages share: the way through the steps, what runs, the look, and being shown anew when something changed."""

from collections.abc import Callable
from importlib import resources
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

from nicegui import ui

from drift_drake.app import stages
from drift_drake.app.jobs import Jobs
from drift_drake.app.pages.parts import box, button, folder_name, stamp, text
from drift_drake.app.project import MAPPING, Project
from drift_drake.common.errors import DriftDrakeError
from drift_drake.view.pages.templates import FOLDER

POLL = 0.5  # [s]
# A chart that is taken off the page hears of its last resize, which plotly answers by a rejection; what is being typed
# is not drawn over; what had the focus when it was drawn anew has it again.
SCRIPT = """<script>
addEventListener("unhandledrejection", event => {
  if (String(event.reason?.message ?? event.reason).startsWith("Resize must be passed")) event.preventDefault();
});
addEventListener("input", event => { window.typing = !["checkbox", "file"].includes(event.target.type); }, true);
for (const name of ["change", "focusout"]) addEventListener(name, () => { window.typing = false; }, true);
let last;
const called = one => one.getAttribute("aria-label") ?? one.textContent;
addEventListener("focusin", event => { last = event.target; });
addEventListener("pointerdown", () => { last = undefined; }, true);
new MutationObserver(() => {
  if (!last || last.isConnected || document.activeElement !== document.body) return;
  const again = [...document.querySelectorAll(last.tagName)].find(one => called(one) === called(last));
  again?.focus({ preventScroll: true });
}).observe(document, { subtree: true, childList: true, attributes: true, attributeFilter: ["inert", "disabled"] });
</script>"""
# Of each window what it has shown, and what draws its way through the steps.
SEEN: WeakKeyDictionary[Any, tuple[tuple[Any, ...], Callable[[], Any]]] = WeakKeyDictionary()


class Step(NamedTuple):
    """A step's address, name, what it does in a sentence, and what draws it."""

    path: str
    name: str
    about: str


STEPS = (
    Step("/", "Logs", "Recordings of one car. Each day becomes a folder of runs."),
    Step("/columns", "Columns", "Which column is which quantity, in which unit, sign and frame."),
    Step("/car", "Car", "A first guess of the car: what the simulator believes."),
    Step("/check", "Check", "Whether these logs are good enough to calibrate on, and which drive is missing."),
    Step("/calibrate", "Calibrate", "The car's parameters from the logs, with intervals."),
    Step("/diagnose", "Diagnose", "Where later days differ from the calibrated car, and why."),
    Step("/apply", "Apply", "The corrected simulator, and what to do with it."),
)


def page(project: Project, jobs: Jobs, step: Step, draw: Callable[[dict[str, Any]], None]) -> None:
    """One page: the frame, and what `draw` makes of the project file's content."""
    own = (resources.files("drift_drake.app.pages") / "look.css").read_text()
    ui.add_head_html(f"<style>{(FOLDER / 'look.css').read_text()}{own}</style>")
    ui.add_head_html(f"{SCRIPT}<script>{(FOLDER / 'keys.js').read_text()}</script>")
    ui.page_title(f"{step.name} - {folder_name(project)} - drift_drake")
    client = ui.context.client
    way = ui.refreshable(_way)

    @ui.refreshable
    def content() -> None:
        SEEN[client] = stamp(project, jobs), way.refresh
        try:
            data = project.read()
            with box("div", id="main"):
                text("h1", step.name)
                text("p", step.about, "note")
                draw(data)
        except DriftDrakeError as error:
            with box("div", "refusal", role="alert"):
                text("p", str(error))

    text("a", "Skip to the content", "skip", href="#main")
    way(project, step)
    box("div", id="uploads", role="status")  # what is said of files stays when the rest is drawn anew
    content()
    bar = box("div", "job", role="status", aria_live="polite")
    shown: list[Any] = [None]

    async def poll() -> None:
        job = jobs.running
        now = None if job is None else (job.stage.title, job.doing, round(100 * job.share), job.cancelled)
        if now != shown[0]:
            shown[0] = now
            bar.clear()
            if job is not None:
                with bar:
                    _running(jobs)
        if stamp(project, jobs) != SEEN[client][0] and not await typing():
            way.refresh()
            content.refresh()

    ui.timer(POLL, poll)


async def typing() -> bool:
    """Whether somebody is typing in this window, whose field may not be drawn anew."""
    try:
        return bool(await ui.run_javascript("window.typing === true", timeout=2.0))
    except TimeoutError:
        return True  # the window does not answer: it is drawn anew once it does


def own_edit(project: Project, jobs: Jobs) -> None:
    """Says that this window has drawn what it has changed itself."""
    client = ui.context.client
    if client in SEEN:
        refresh = SEEN[client][1]
        SEEN[client] = stamp(project, jobs), refresh
        refresh()


def _way(project: Project, step: Step) -> None:
    try:
        data = project.read()
    except DriftDrakeError:
        return
    with box("header"):
        text("p", folder_name(project), "project")
        with box("nav", aria_label="Steps"), box("ol"):
            for one in STEPS:
                done = _state(project, one, data)
                with box("li"):
                    link = text("a", one.name, f"step {done}", href=one.path)
                    link.props["aria-label"] = f"{one.name}: {stages.STATES[done]}"
                    if one is step:
                        link.props["aria-current"] = "step"


def _state(project: Project, step: Step, data: dict[str, Any]) -> str:
    """The state of the worst of a step's commands."""
    days = project.days(data)
    of: dict[str, list[stages.Stage]] = {
        "Check": [stages.check_day(project, day, data) for day in stages.baseline(project, data)],
        "Calibrate": [stages.calibrate(project, data)],
        "Diagnose": [stages.diagnose(project, day, data) for day in days],
        "Apply": [stages.apply(project, day, data) for day in days],
        "Columns": [stages.import_day(project, day, data) for day, names in days.items() if names],
    }
    if step.name == "Logs":
        return "done" if days else "none"
    if step.name == "Car":
        return "done" if (project.folder / stages.first_guess(data)).exists() else "none"
    if step.name == "Columns" and not (project.folder / MAPPING).exists():
        return "none"
    found = [stage.state(data) for stage in of[step.name]]
    order = ("running", "stale", "refused", "cancelled", "none", "done")
    if step.name in ("Diagnose", "Apply") and "done" in found:
        order = ("running", "stale", "refused", "cancelled", "done", "none")
    return next((state for state in order if state in found), "none")


def _running(jobs: Jobs) -> None:
    job = jobs.running
    if job is None:
        return
    doing = "is being cancelled" if job.cancelled else f"{job.doing} ({100 * job.share:.0f} %)"
    text("span", f"{job.stage.title[0].upper()}{job.stage.title[1:]}: {doing}")
    box("progress", aria_label="Progress", max="100", value=f"{100 * job.share:.0f}")
    button("Cancel", jobs.cancel, label=f"Cancel {job.stage.title}", off=bool(job.cancelled))
