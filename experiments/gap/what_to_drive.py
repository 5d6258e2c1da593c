"""Does the planned drive resolve what a first log left open?

    python -m experiments.gap.what_to_drive --out runs/what_to_drive

Cars with one withheld effect each, and deviations from their file within tolerance, are driven gently: along a lane
with one slow sway. Where the diagnosis of that log does not give the truth nine tenths of the probability, and `none`
or an effect is its rival, the next drive is planned from the answer alone and driven (Drake plants, the tracking
feedback, the sensors' noise), compared with two drives of the same length and lane that anyone would think of: straight
acceleration and a slalom. Each is diagnosed together with the first log. All cases found ambiguous are shown.
Broken off, the experiment goes on where it was (give --out).
"""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.mpc.tracking import tracking_gains
from drift_drake.gap.diagnosis.answers.answer import UnplannableError
from drift_drake.gap.diagnosis.likelihood.beliefs import Belief, Sensing
from drift_drake.gap.diagnosis.likelihood.diagnose import diagnose
from drift_drake.gap.evidence.posterior import UNKNOWN
from drift_drake.gap.next_drive.plan import NextDriveConfig, plan_from_answer, solved_plans
from drift_drake.view.colours import INK, RUNS
from drift_drake.view.style import new_figure, save, styled
from experiments.benchmarks.drake_cases import drive
from experiments.benchmarks.drivers import PERIOD, STEERING_RATE, TORQUE_RATE, slewed
from experiments.benchmarks.truths import drawn_truth
from experiments.made import RunConfig, begun, tabulated, write_results
from experiments.settings import kept

SETTLED = 0.9  # probability of the truth from which on a first log leaves nothing open
GENTLE, GENTLE_PERIOD = 0.3, 9.0  # [m], [s] of the first drive's sway
SLALOM, SLALOM_PERIOD = 1.5, 1.5  # [m], [s]
DRIVES = ("first log", "straight", "slalom", "planned")


@dataclasses.dataclass(frozen=True)
class WhatToDriveConfig(RunConfig):
    """How many cases."""

    ambiguous: int = 14
    """Cases that the first log leaves open, at which the experiment stops."""
    most: int = 60
    """Cases that are tried at most."""
    seed: int = 83_000


class PlanDriver:
    """Follows a plan row by row: its commands, and the tracking feedback for the car that the file describes."""

    def __init__(self, x: np.ndarray, u: np.ndarray, vehicle: VehicleParameters) -> None:
        self._x, self._u, self._vehicle = x, u, vehicle
        gains = tracking_gains(NominalStepModel(vehicle), x, u, np.zeros(len(u) - 1))
        self._gains = np.concatenate([gains, gains[-1:]])

    def start(self) -> np.ndarray:
        """First state (r, v, beta, omega_r)."""
        return np.array(self._x[0, :4])

    def resting_command(self) -> tuple[float, float]:
        """Command before the first row."""
        return float(self._u[0, 0]), float(self._u[0, 1])

    def command(self, t: float, state: np.ndarray, last: tuple[float, float]) -> tuple[float, float]:
        """Command a row after t."""
        correction = self._at(self._gains, t) @ (state[:6] - self._at(self._x, t))
        delta, tau = self._at(self._u, t + PERIOD) + correction
        v = self._vehicle
        return (
            slewed(float(delta), last[0], STEERING_RATE, -v.steering_limit, v.steering_limit),
            slewed(float(tau), last[1], TORQUE_RATE, v.torque_min, v.torque_max),
        )

    @staticmethod
    def _at(values: np.ndarray, t: float) -> np.ndarray:
        position = min(t / DT, len(values) - 1.0)
        k = min(int(position), len(values) - 2)
        return np.asarray(values[k] + (position - k) * (values[k + 1] - values[k]))


def plain_plan(
    vehicle: VehicleParameters, size: float, period: float, v_end: float = 20.0
) -> tuple[np.ndarray, np.ndarray]:
    """(states, inputs) of a lane drive of the car that the file describes, along a sine."""
    config = NextDriveConfig(alpha=0.0, starts=1, v_end=v_end)
    nothing = Belief((), 1.0, np.zeros(12), np.eye(12))
    sensing = Sensing(np.ones(9), np.ones(9, dtype=np.bool_), np.ones(9))
    lateral = size * np.sin(2.0 * np.pi * np.arange(config.steps + 1) * DT / period)
    return next(solved_plans(vehicle, sensing, (nothing, nothing), config, lateral))


def one_case(index: int, config: WhatToDriveConfig) -> dict[str, Any]:
    """First log, and where it leaves the truth open the drives that follow."""
    vehicle = VehicleParameters()
    rng = np.random.default_rng([config.seed, index])
    truth = drawn_truth(rng, "tolerance", vehicle)
    name = next(iter(truth.effects))
    seeds = [int(s) for s in rng.integers(2**31, size=4)]

    def driven(number: int, plan: tuple[np.ndarray, np.ndarray], heading: float = 0.0) -> Run:
        x, u = plan
        duration = (len(u) - 1) * DT
        return drive(PlanDriver(x, u, vehicle), truth, vehicle, seeds[number], f"run_{number}", duration, heading)

    first = driven(0, plain_plan(vehicle, GENTLE, GENTLE_PERIOD, v_end=14.0))
    answer = diagnose([first], vehicle, case=f"{index:03d}", workers=1).answer
    probability = answer.posterior.get(name, 0.0)
    out: dict[str, Any] = {
        "case": index,
        "truth": dataclasses.asdict(truth),
        "first log": {"probability": probability, "said": said(answer.posterior), "ambiguity": answer.ambiguity},
    }
    rivals = [other for other in answer.posterior if other not in (name, UNKNOWN)]
    if probability >= SETTLED or answer.posterior[rivals[0]] < 1.0 - SETTLED:
        return out | {"ambiguous": False}
    try:
        plan = plan_from_answer(answer, vehicle)
    except UnplannableError as error:
        return out | {"ambiguous": True, "planned": {"failed": str(error), "probability": probability}}
    drives = {
        "straight": driven(1, plain_plan(vehicle, 0.0, 1.0)),
        "slalom": driven(2, plain_plan(vehicle, SLALOM, SLALOM_PERIOD)),
        "planned": driven(3, (plan.x, plan.u), plan.heading),
    }
    out |= {"ambiguous": True, "plan": {"sentence": plan.sentence(), "kind": plan.kind, "after": plan.after,
                                        "before": plan.before, "truth was among them": name in plan.names}}  # fmt: skip
    for kind, run in drives.items():
        after = diagnose([first, run], vehicle, case=f"{index:03d}-{kind}", workers=1).answer
        out[kind] = {
            "probability": after.posterior.get(name, 0.0),
            "said": said(after.posterior),
            "ambiguity": after.ambiguity,
            "seconds": float(run.t[-1]),
        }
    return out


def said(posterior: dict[str, float]) -> str:
    """The leading hypothesis."""
    return max(posterior, key=lambda name: posterior[name])


def summarise(cases: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Probability of the truth after each drive, and how often it leads, or is all but certain."""
    open_cases = [case for case in cases if case["ambiguous"]]
    summary: dict[str, Any] = {"tried": len(cases), "ambiguous": len(open_cases)}
    for kind in DRIVES:
        p = np.array([case[kind]["probability"] for case in open_cases if kind in case])
        right = [case[kind].get("said") == next(iter(case["truth"]["effects"])) for case in open_cases if kind in case]
        summary[kind] = {
            "mean": float(np.mean(p)),
            "median": float(np.median(p)),
            "least": float(np.min(p)),
            "settled": int(np.sum(p >= SETTLED)),
            "leads": int(np.sum(right)),
        }
    forecast = [case["plan"]["after"] for case in open_cases if "plan" in case]
    summary["forecast by the plans, mean"] = float(np.mean(forecast))
    return summary


def table(summary: dict[str, Any]) -> str:
    """The summary as Markdown."""
    heads = (f"diagnosed from ({summary['ambiguous']} cases)", "probability of the truth, mean", "median", "least",
             "truth leads", f"above {SETTLED:g}")  # fmt: skip
    rows = []
    for kind in DRIVES:
        s = summary[kind]
        label = kind if kind == DRIVES[0] else f"with {kind} drive"
        rows.append((label, *(f"{s[q]:.2f}" for q in ("mean", "median", "least")), s["leads"], s["settled"]))
    return "\n".join(tabulated(heads, rows))


@styled
def picture(cases: Sequence[dict[str, Any]]) -> Figure:
    """Probability of the truth in each ambiguous case: after the first log, and with each further drive."""
    open_cases = sorted((c for c in cases if c["ambiguous"]), key=lambda c: c["first log"]["probability"])
    figure = new_figure(7.0, 0.9 + 0.26 * len(open_cases))
    ax = figure.subplots()
    looks = (("|", INK, 0.0), ("^", RUNS[5], -0.18), ("s", RUNS[1], 0.18), ("o", RUNS[0], 0.0))
    for kind, (marker, color, shift) in zip(DRIVES, looks, strict=True):
        p = [case[kind]["probability"] if kind in case else np.nan for case in open_cases]
        label = kind if kind == DRIVES[0] else f"and {kind} drive"
        ax.plot(p, np.arange(len(p)) + shift, marker, color=color, ms=6 if kind != "planned" else 7, label=label,
                alpha=0.9, clip_on=False)  # fmt: skip
    labels = []
    for case in open_cases:
        name = next(iter(case["truth"]["effects"]))
        rival = next((r for r in case["first log"]["ambiguity"] if r not in (name, UNKNOWN)), case["first log"]["said"])
        labels.append(f"{name}\n or {rival}?")
    ax.set_yticks(np.arange(len(labels)), labels, fontsize=5.5)
    ax.set(xlim=(-0.01, 1.01), xlabel="probability given to the true effect")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(DRIVES))
    return figure


def main(config: WhatToDriveConfig) -> None:
    """Runs cases until enough were ambiguous, then writes numbers and the picture."""
    folder = begun("what_to_drive", config)
    cases: list[dict[str, Any]] = []
    with tqdm(total=config.ambiguous, unit="ambiguous case") as bar:
        for index in range(config.most):
            if bar.n == config.ambiguous:
                break
            cases.append(kept(folder / f"case-{index:03d}.json", partial(one_case, index, config)))
            bar.update(int(cases[-1]["ambiguous"]))
    summary = summarise(cases)
    save(picture(cases), folder / "what_to_drive.png")
    write_results(folder, config, summary, table(summary))


if __name__ == "__main__":
    run_command(main, WhatToDriveConfig)
