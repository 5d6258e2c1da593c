"""A report's page: where it came from, what its words mean, its charts, and the command that comes next."""

import dataclasses
import datetime
import platform
import shlex
from importlib.metadata import version
from pathlib import Path
from typing import Any

from markupsafe import Markup
from plotly.offline import get_plotlyjs

from drift_drake.view.colours import CARS
from drift_drake.view.pages.policy import with_policy
from drift_drake.view.pages.templates import templates

PACKAGES = ("drift_drake", "drake", "numpy", "scipy", "numba")
GLOSSARY = {
    "gap": "what the simulator's car gets wrong about the real one, beyond sensor noise and baseline residuals",
    "nominal car": "the car of the vehicle file, as it is",
    "calibrated car": "the vehicle file that 'drift-drake identify' fitted to logs of a baseline",
    "corrected car": "the nominal or calibrated car with the named effects added",
    "effect": "a physical cause of the catalogue, with a magnitude: a delay, a mass, a friction level",
    "none": "verdict: no gap beyond tolerances, sensor noise and the car's baseline residuals",
    "unknown": "verdict: there is a gap, and no effect of the catalogue explains it",
    "probability": "posterior probability of a hypothesis, given these logs and the catalogue",
    "95 % interval": "holds the true magnitude with 95 % probability, if the named effect is the cause",
    "ambiguity set": "the hypotheses that together hold 95 % of the probability",
    "innovation": "measured less predicted one row ahead, in standard deviations: white noise of size one where the "
    "model is right",
    "free-form forces": "forces and moments added to the car's, any function of its state: no catalogue is needed",
    "held out": "of parts of the runs that were not used to fit what they judge",
    "nat": "unit of log evidence: three nats make one hypothesis twenty times as probable as another",
    "detection limit": "the least magnitude of an effect that would be named with 95 % probability from these logs",
    "sideslip (beta)": "angle from the car's heading to its direction of travel, positive to the left",
    "yaw rate (r)": "rate of the heading, positive to the left",
    "omega_r": "speed of the driven rear rim [m/s], equal to the car's speed where the tyre rolls",
    "rear slip": "rim speed less the speed over ground along the car, over the rim speed",
}


@dataclasses.dataclass(frozen=True)
class Source:
    """Where a report came from, as far as it is known."""

    command: str = ""
    case: Path | None = None  # folder of the logs
    vehicle: Path | None = None
    calibration: Path | None = None
    answer: Path | None = None
    date: datetime.datetime = dataclasses.field(default_factory=datetime.datetime.now)

    def rows(self) -> list[tuple[str, str]]:
        """The page's head, as names and texts."""
        files = {"logs": self.case, "vehicle": self.vehicle, "calibration": self.calibration, "answer": self.answer}
        known = [(name, str(path)) for name, path in files.items() if path is not None]
        return [*known, ("date", f"{self.date:%Y-%m-%d %H:%M}")]

    def command_for(self, name: str, *more: str) -> str:
        """A further command on the same answer and vehicle file."""
        answer, vehicle = str(self.answer or "ANSWER.json"), str(self.vehicle or "CAR.yaml")
        return shlex.join(["drift-drake", name, answer, "--vehicle", vehicle, *more])

    def replay_command(self, run: str) -> str:
        """Real, nominal and corrected car side by side."""
        log = str((self.case or Path("LOGS")) / f"{run}.csv")
        return shlex.join(
            ["drift-drake", "replay", log, "--vehicle", str(self.vehicle or "CAR.yaml"), "--corrected",
             "corrected.yaml", "--html", "replay.html"]
        )  # fmt: skip


def page_html(template: Path, words: tuple[str, ...], **values: Any) -> str:
    """A template that extends `page.html`, filled in.

    Args:
        words: of the glossary that the page explains.
    """
    environment = templates(template.parent)
    environment.globals |= {
        "versions": [*((name, version(name)) for name in PACKAGES), ("Python", platform.python_version())],
        "glossary": {word: GLOSSARY[word] for word in words},
        "colours": CARS,
    }
    # Rendered first: plotly.js is put in where the page has charts.
    html = environment.get_template(template.name).render(**values)
    script = Markup(f"<script>{get_plotlyjs()}</script>") if 'class="chart"' in html else Markup("")
    return with_policy(html.replace("<!-- plotly -->", script))
