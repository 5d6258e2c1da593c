"""The paper's claims in its own order, each with the data that it is judged by."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from drift_drake.common.run_folder import is_done
from drift_drake.drive.reference.trajectory import Reference
from experiments.drifting.report import held
from experiments.drifting.runs import reference
from experiments.made import tabulated
from experiments.paper.parts import KINDS, Kind, Part
from experiments.paper.verdicts import NOTHING, Cell, falls_short, more, ranked, ratio, share, turned

DRIFT = 0.3  # [rad] of sideslip, half of that of the figure-8: what is less is no drift
ALIKE = 0.25  # two plans differ by less than this share of what sets the first apart from the straight drive
PAPER_RATIO = 20.0  # of the prior's total norm over Twice-Info's
PERIOD = 10.0  # [ms]
BUSY = 1.2  # load of a core from which on wall time is not judged
NONE = pd.DataFrame({"model": [], "vehicle": [], "noise_seed": []})


class Evidence(NamedTuple):
    """What was run under the recipe, or as shipped; no rows of what was not."""

    figure_8: pd.DataFrame
    loops: pd.DataFrame
    drives: pd.DataFrame
    load: float = np.inf  # of a core of the machine, while the figure-8 was driven

    def drifts(self, model: str) -> pd.DataFrame:
        """Runs of the figure-8."""
        return self.figure_8[self.figure_8["model"] == model]

    def entered(self, model: str) -> pd.DataFrame:
        """Runs of the loops."""
        return self.loops[self.loops["model"] == model]

    def driven(self, model: str) -> pd.DataFrame:
        """Informative, or straight, drives."""
        return self.drives[self.drives["model"] == model]


class Claim(NamedTuple):
    """One claim: where the paper makes it, its part, what the paper reports, and what judges it."""

    where: str
    what: str
    part: Part
    paper: str
    judge: Callable[[Evidence], Cell]


def transitions(course: Reference) -> list[tuple[float, float]]:
    """Path positions [m] at which each transition begins and ends."""
    grid = np.arange(0.0, course.distance, 0.5)
    inside = np.append(course.transition(grid).astype(int), 0)
    edges = np.flatnonzero(np.diff(inside, prepend=0))
    return [(float(grid[a]), float(grid[min(b, len(grid) - 1)])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def read_runs(file: Path, maneuver: str) -> pd.DataFrame:
    """A folder's runs with what is asked of them: held, past the first transition, in time; empty without a file."""
    if not file.exists():
        return NONE
    runs, course = pd.read_csv(file), reference("figure_8" if maneuver == "figure_8" else "loops")
    first = transitions(course)[0][1]
    runs = runs.assign(
        held=held(runs),
        past_first=runs["completion"] * course.distance > first,
        in_time=runs["solve_ms_median"] < PERIOD,
    )
    if "established_after" in runs:
        runs["never"] = np.isinf(runs["established_after"].fillna(np.inf))
        runs["established_after"] = runs["established_after"].fillna(np.inf)
    return runs


def read_drives(file: Path, variant: str) -> pd.DataFrame:
    """A variant's drives with what is asked of them."""
    if not file.exists():
        return NONE
    drives = pd.read_csv(file)
    drives = drives[drives["variant"] == variant].assign(noise_seed=0)
    for name in ("error", "deviation"):
        columns = [f"{name}_{state}" for state in ("r", "v", "beta", "omega_r")]
        drives[name] = np.exp(np.mean(np.log(drives[columns].to_numpy(dtype=float)), axis=1))
    drives["both_ways"] = np.minimum(drives["left"], drives["right"])
    drives["no_drift"] = drives["max_beta"] < DRIFT
    drives["alike"] = drives["total_unlike"] < ALIKE if "total_unlike" in drives else False
    return drives


def evidence(folder: Path, kind: Kind) -> Evidence:
    """What a folder of this command holds."""
    return Evidence(
        read_runs(folder / "figure_8" / kind / "runs.csv", "figure_8"),
        read_runs(folder / "loops" / kind / "runs.csv", "loops"),
        read_drives(folder / "drives" / "drives.csv", kind),
        read_load(folder / "parts.json", f"figure_8/{kind}"),
    )


def read_load(file: Path, part: str) -> float:
    """The load of a core while a part was run; infinite where nobody knows."""
    done = json.loads(file.read_text()) if is_done(file) else {}
    return float(done.get(part, {}).get("load of a core", np.inf))


def _in_time(e: Evidence) -> Cell:
    # Wall time says nothing of the method where other work waits for the same cores.
    return share(e.drifts("twice_info"), "in_time") if e.load < BUSY else NOTHING._replace(text="machine busy")


def _informative(e: Evidence, flag: str) -> Cell:
    drives = e.drives[e.drives["model"].isin(["Once-Info", "Twice-Info"])]
    return share(drives.assign(**{flag: drives[flag].astype(bool)}), flag) if len(drives) else NOTHING


def _alike(e: Evidence) -> Cell:
    drives = e.driven("Twice-Info")
    known = drives[drives["total_unlike"].notna()] if "total_unlike" in drives else NONE
    return share(known, "alike") if len(known) else NOTHING


def _norm(above: str, below: str, column: str = "total", bar: float = 1.0) -> Callable[[Evidence], Cell]:
    return lambda e: ratio(e.driven(above), e.driven(below), column, bar, digits=2)


def _error(worse: str, better: str, column: str = "rms_e", unit: str = " m") -> Callable[[Evidence], Cell]:
    digits = 2 if column == "rms_e" else 3
    return lambda e: ratio(ranked(e.drifts(worse), column), ranked(e.drifts(better), column), column, 1.0, unit, digits)


CLAIMS: Sequence[Claim] = (
    Claim("Abstract (i)", "the framework controls the car reliably at the edge of stability: Twice-Info completes the "
          "figure-8", "figure_8", "3 of 3", lambda e: share(e.drifts("twice_info"), "completed")),
    Claim("Abstract (ii)", "adapting online alone may not suffice: on the loops it falls short of Twice-Info", "loops",
          "large transients, both completed", lambda e: falls_short(e.entered("online"), e.entered("twice_info"))),
    Claim("Abstract (ii)", "the same on the figure-8, which the paper did not drive with it", "figure_8", "-",
          lambda e: falls_short(e.drifts("online"), e.drifts("twice_info"))),
    Claim("Abstract (iii)", "active data collection helps: Twice-Info completes more figure-8s than Once-OCP",
          "figure_8", "3 against 0 of 3", lambda e: more(e.drifts("twice_info"), e.drifts("once_ocp"), "completed")),
    Claim("Contribution 1", "adapting the last layer improves on the model that does not adapt (figure-8, RMS e)",
          "figure_8", "not measured apart", _error("prior", "online")),
    Claim("Contribution 2", "constraints hold during data collection: informative drives stay in the lane to their end",
          "drives", "on the track", lambda e: _informative(e, "kept")),
    Claim("Contribution 3", "the meta-trained model, adapting online, more often never establishes the drift of the "
          "loops than Twice-Info", "loops", "established late",
          lambda e: more(e.entered("online"), e.entered("twice_info"), "never")),
    Claim("Contributions", "information-rich drives need not drift: sideslip below 0.3 rad", "drives",
          "not exactly drifting", lambda e: _informative(e, "no_drift")),
    Claim("V-A", "Info-OCP applies larger torques than OCP", "drives", "larger",
          _norm("Once-Info", "Once-OCP", "max_tau")),
    Claim("V-A", "and steers in each direction: the smaller of both ways, over OCP's", "drives", "each direction",
          _norm("Once-Info", "Once-OCP", "both_ways")),
    Claim("V-A, Table I", "one informative drive leaves a smaller total norm than a straight one", "drives",
          "3.79 against 3.24, 1.17", _norm("Once-OCP", "Once-Info")),
    Claim("V-A, Table I", "so does it in yaw rate", "drives", "1.43 against 0.81, 1.77",
          _norm("Once-OCP", "Once-Info", "norm_r")),
    Claim("V-A, Table I", "the second one lowers it again", "drives", "3.24 against 1.71, 1.89",
          _norm("Once-Info", "Twice-Info")),
    Claim("V-A, Table I", "both lower the total norm to a twentieth", "drives", "33.98 against 1.71, 19.9",
          _norm("prior", "Twice-Info", "total", PAPER_RATIO)),
    Claim("V-A", "the second drive reaches larger yaw rates than the first", "drives", "larger",
          _norm("Twice-Info", "Once-Info", "max_r")),
    Claim("V-A", "and applies larger torques", "drives", "larger", _norm("Twice-Info", "Once-Info", "max_tau")),
    Claim("IV", "the total information along the horizon plans much the same second drive as eq. (9)", "drives",
          "no substantial difference", _alike),
    Claim("V-A, predictions", "one step's predictions at r 0.9, v 14.5, beta -0.45, omega_r 21, tau 200 come nearer to "
          "the car", "drives", "figure", _norm("prior", "Twice-Info", "error")),
    Claim("V-A, predictions", "and surer", "drives", "figure", _norm("prior", "Twice-Info", "deviation")),
    Claim("V-B", "Once-OCP does not complete the figure-8 reliably", "figure_8", "0 of 3",
          lambda e: turned(share(e.drifts("once_ocp"), "completed"))),
    Claim("V-B", "nor does Once-Info", "figure_8", "0 of 3",
          lambda e: turned(share(e.drifts("once_info"), "completed"))),
    Claim("V-B", "Twice-Info completes more than Once-Info", "figure_8", "3 against 0 of 3",
          lambda e: more(e.drifts("twice_info"), e.drifts("once_info"), "completed")),
    Claim("V-B", "one round helps to complete the first transition", "figure_8", "yes against no",
          lambda e: more(e.drifts("once_info"), e.drifts("once_ocp"), "past_first")),
    Claim("V-B, Table II", "Twice-Info's RMS e is below Once-OCP's", "figure_8", "3.19 against 0.83 m, 3.8",
          _error("once_ocp", "twice_info")),
    Claim("V-B, Table II", "and below Once-Info's", "figure_8", "1.31 against 0.83 m, 1.6",
          _error("once_info", "twice_info")),
    Claim("V-B, Table III", "its RMS sideslip error is below Once-OCP's", "figure_8", "0.261 against 0.070 rad, 3.7",
          _error("once_ocp", "twice_info", "rms_sideslip_error", " rad")),
    Claim("V-B, Table III", "and below Once-Info's", "figure_8", "0.348 against 0.070 rad, 5.0",
          _error("once_info", "twice_info", "rms_sideslip_error", " rad")),
    Claim("V-C", "with online adaptation alone the loops are completed", "loops", "the better of 2",
          lambda e: share(e.entered("online"), "completed")),
    Claim("V-C", "it takes longer than Twice-Info until the drift is established", "loops", "150 m and more",
          lambda e: ratio(e.entered("online"), e.entered("twice_info"), "established_after", 1.0, " m", 0)),
    Claim("V-C", "Twice-Info drifts across all transitions", "loops", "the better of 2",
          lambda e: share(e.entered("twice_info"), "held")),
    Claim("V", "plans are solved at 100 Hz (a run's median)", "figure_8", "about 100 Hz", _in_time),
)  # fmt: skip


def claims_table(found: dict[Kind, Evidence]) -> str:
    """All claims, as Markdown."""
    heads = ("where", "claim", "`--parts`", "the paper", "its recipe here", "verdict", "as shipped", "verdict")
    rows = []
    for claim in CLAIMS:
        cells = [cell for kind in KINDS for cell in _cells(claim.judge(found[kind]))]
        rows.append((claim.where, claim.what, claim.part, claim.paper, *cells))
    return "\n".join(tabulated(heads, rows))


def _cells(cell: Cell) -> tuple[str, str]:
    return cell.text, f"**{cell.verdict}**" if cell.verdict == "does not hold" else cell.verdict


def failed_at(runs: pd.DataFrame, course: Reference) -> pd.Series:
    """Where each run that was not completed ended: which transition, or the drift after which."""
    edges = transitions(course)

    def place(completion: float) -> str:
        s = completion * course.distance
        for number, (begin, end) in enumerate(edges, 1):
            if s < begin:
                return f"before transition {number}"
            if s <= end:
                return f"in transition {number}"
        return f"after transition {len(edges)}"

    return runs.loc[~runs["completed"], "completion"].map(place)
