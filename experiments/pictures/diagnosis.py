"""A diagnosis as an animation: the log, what its simulator predicts, the gap, the hypotheses, the corrected simulator.

The last moment is the still picture.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.common.errors import significant
from drift_drake.common.safe_files import replacing
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.answers.apply import corrected_vehicle
from drift_drake.gap.diagnosis.diagnose import diagnose
from drift_drake.gap.estimation.windows import STATES, run_errors, windowed
from drift_drake.view.colours import CARS, INK
from drift_drake.view.style import DEGREES, KMH, new_figure, save
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth
from experiments.pictures.look import BLUE, HEAD, WIDTH, for_pages

HEIGHT, RESOLUTION = 5.0, 140  # [in], [dots per inch]
SECONDS = 8.0  # of the log
TRUTH = {"steering_lag": 0.1}  # what the car has and its simulator lacks [s]
SIGNALS = (("yaw rate [deg/s]", DEGREES), ("speed [km/h]", KMH), ("sideslip [deg]", DEGREES), ("rim speed [km/h]", KMH))
HYPOTHESES = 5  # that are shown
MOVES, MOVE, REST, LAST = 8, 70, 1900, 3500  # pictures of a change, their time and that of what is then shown [ms]
TITLE = -0.65  # of the lower panel's width, where its title begins
COLOURS = 64  # of the animation


@dataclasses.dataclass(frozen=True)
class Diagnosed:
    """The log, times [n] [s] of predictions half a second ahead, their errors [n, 4] (SI) by both cars, the answer."""

    log: Run
    t: Array
    nominal: Array
    corrected: Array
    answer: Answer

    def predicted(self, errors: Array) -> Array:
        """Yaw rates [n] [deg/s]."""
        return (np.interp(self.t, self.log.t, self.log.r) - errors[:, 0]) * DEGREES

    def rms(self, errors: Array) -> Array:
        """By signal [4], in the units of `SIGNALS`."""
        return np.asarray(np.sqrt(np.mean(errors**2, axis=0)) * [factor for _, factor in SIGNALS])


def diagnosed() -> Diagnosed:
    """Of a simulated slalom."""
    car = VehicleParameters()
    (log,) = make_case(Truth(TRUTH, {}, {}), car, np.random.default_rng(3), manoeuvres=("slalom",))
    log = log.rows(0, round(SECONDS / log.period))
    run, answer = windowed(log), diagnose([log], car, case="slalom").answer
    vehicle, effects = corrected_vehicle(car, answer)
    errors = [run_errors(run, vehicle.constants(), effects)[:, -1, :STATES]
              for vehicle, effects in ((car, make_effects({})), (vehicle, effects))]  # fmt: skip
    times = log.t[0] + (run.starts + run.stride_rows * len(run.horizons)) * run.period
    return Diagnosed(log, times, errors[0], errors[1], answer)


def yaw_rates(axes: Any, found: Diagnosed, errors: Array | None, share: float, car: str, logged: float = 1.0) -> None:
    """The upper panel: a share of the log, and of a car's predictions."""
    until = found.log.t <= found.log.t[0] + logged * SECONDS
    axes.plot(found.log.t[until], found.log.r[until] * DEGREES, color=INK, linewidth=4.5, alpha=0.35)
    if errors is not None:
        shown = round(share * len(found.t))
        axes.plot(found.t[:shown], found.predicted(errors)[:shown], "o-", color=CARS[car], markersize=3.5,
                  linewidth=1.2)  # fmt: skip
    highest = 1.25 * float(np.max(np.abs(found.log.r))) * DEGREES
    axes.set(xlim=(found.log.t[0], found.log.t[0] + SECONDS), ylim=(-highest, highest), xlabel="time [s]")
    axes.set_title("yaw rate [deg/s]")


def steering(axes: Any, found: Diagnosed, share: float) -> None:
    """The lower panel: a share of the log's commands."""
    until = found.log.t <= found.log.t[0] + share * SECONDS
    axes.set_position((0.1, 0.05, 0.87, 0.28))
    axes.plot(found.log.t[until], found.log.delta_cmd[until] * DEGREES, color=INK)
    highest = 1.25 * float(np.max(np.abs(found.log.delta_cmd))) * DEGREES
    axes.set(xlim=(found.log.t[0], found.log.t[0] + SECONDS), ylim=(-highest, highest), xticklabels=())
    axes.set_title("steering command [deg]")


def bars(axes: Any, names: list[str], values: list[float], texts: list[str], colour: str, ghosts: list[float]) -> None:
    """The lower panel: a bar for each name, 0 to 1, a pale one behind it, and what it says."""
    places = np.arange(len(names))
    axes.barh(places, ghosts, color=CARS["nominal"], alpha=0.25, height=0.6)
    axes.barh(places, values, color=colour, height=0.6)
    for i, text in enumerate(texts):
        axes.text(1.03, i, text, va="center")
    axes.set(xlim=(0.0, 1.0), ylim=(HYPOTHESES - 0.5, -0.6), xticks=[], yticks=places, yticklabels=names)
    axes.tick_params(length=0.0)
    axes.grid(visible=False)
    for side in axes.spines.values():
        side.set_visible(False)


def gap(axes: Any, found: Diagnosed, share: float, errors: Array, colour: str) -> None:
    """Root mean squares of errors by signal, relative to the nominal car's."""
    before, now = found.rms(found.nominal), found.rms(errors)
    first = errors is found.nominal
    values = share * np.ones(STATES) if first else 1.0 + share * (now / before - 1.0)
    shown = values * before
    bars(axes, [name for name, _ in SIGNALS], list(values), [significant(float(value), 2) for value in shown], colour,
         [0.0 if first else 1.0] * STATES)  # fmt: skip
    axes.set_title("RMS error half a second ahead", x=TITLE)


def hypotheses(axes: Any, found: Diagnosed, share: float) -> None:
    """The likeliest, from equal probabilities to those that the log gives."""
    named = sorted(found.answer.posterior.items(), key=lambda item: -item[1])[:HYPOTHESES]
    equal = 1.0 / len(found.answer.posterior)
    values = [equal + share * (p - equal) for _, p in named]
    names, texts = [name.replace("+", "\n+ ") for name, _ in named], [f"{value:.2f}" for value in values]
    bars(axes, names, values, texts, BLUE, [0.0] * len(named))
    axes.set_title("probability of each hypothesis", x=TITLE)


def scenes(found: Diagnosed) -> list[tuple[str, Callable[[Any, Any, float], None]]]:
    """What each says, and how it is drawn in two axes at a share of its change."""
    (name,) = found.answer.causes
    said = f"5  {name} {found.answer.magnitudes[name].estimate:.3f} s (true: {TRUTH[name]:g} s)"

    def log(upper: Any, lower: Any, share: float) -> None:
        yaw_rates(upper, found, None, 0.0, "nominal", logged=share)
        steering(lower, found, share)

    def predicted(upper: Any, lower: Any, share: float) -> None:
        yaw_rates(upper, found, found.nominal, share, "nominal")
        steering(lower, found, 1.0)

    def errors(upper: Any, lower: Any, share: float) -> None:
        yaw_rates(upper, found, found.nominal, 1.0, "nominal")
        gap(lower, found, share, found.nominal, CARS["nominal"])

    def causes(upper: Any, lower: Any, share: float) -> None:
        yaw_rates(upper, found, found.nominal, 1.0, "nominal")
        hypotheses(lower, found, share)

    def corrected(upper: Any, lower: Any, share: float) -> None:
        yaw_rates(upper, found, found.corrected, share, "corrected")
        gap(lower, found, share, found.corrected, CARS["corrected"])

    return [("1  A log of the car", log), ("2  What its simulator predicts", predicted), ("3  The gap", errors),
            ("4  Which effect explains it?", causes), (said, corrected)]  # fmt: skip


@for_pages
def moment(title: str, panels: Callable[[Any, Any, float], None], share: float) -> Figure:
    """One picture."""
    figure = new_figure(WIDTH, HEIGHT)
    figure.set_layout_engine("none")
    figure.text(0.02, 0.955, title, size=HEAD + 1.0, weight="bold", va="center")
    panels(figure.add_axes((0.1, 0.52, 0.87, 0.34)), figure.add_axes((0.4, 0.03, 0.46, 0.31)), share)
    return figure


def pixels(figure: Figure) -> Image.Image:
    """Of a figure."""
    figure.set_dpi(RESOLUTION)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def animate(out: Path) -> None:
    """Writes the animation, and its last moment as a PNG next to it."""
    pictures, times = [], []
    shown = scenes(diagnosed())
    for title, panels in shown:
        pictures += [pixels(moment(title, panels, (i + 1) / MOVES)) for i in range(MOVES)]
        times += [MOVE] * (MOVES - 1) + [REST]
    times[-1] = LAST
    rests = Image.fromarray(np.vstack([np.asarray(picture) for picture in pictures[MOVES - 1 :: MOVES]]))
    palette = rests.quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
    first, *others = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures)
    with replacing(out) as part:
        first.save(part, format="GIF", save_all=True, append_images=others, duration=times, loop=0)
    save(moment(*shown[-1], 1.0), out.with_suffix(".png"))
