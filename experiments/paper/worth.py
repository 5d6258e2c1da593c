"""What each of the things is worth that `--as-in-paper` turns off since the paper has not them: one at a time.

    python -m experiments.paper.worth --vehicles 4

The figure-8 under the paper's recipe, with one of them on (Twice-Info, and the adapting prior, which the gate needs),
and with all. Broken off, it goes on where it was (give --out).
"""

import dataclasses

from diagrams.command import run_command
from drift_drake.common.safe_files import write_table
from drift_drake.drive.gathering.config import GatheringConfig
from experiments.benchmarks.vehicles import Population
from experiments.drifting.improvements import ImprovementsConfig, Rung, drive_ladder, medians_table, summarise_ladder
from experiments.drifting.report import LABELS, differences_table, pair_of
from experiments.drifting.runs import EXTRAS, Model
from experiments.gathering.recipe import Extra, as_in_paper
from experiments.made import RunConfig, SpreadConfig, begun, write_results

WORDS: dict[Extra, str] = {
    "screening": "the screen of measurements",
    "gate": "the gate of the adapter's samples",
    "fresh_guesses": "plans from fresh guesses",
    "delay": "the prediction over the delay",
    "safe_stop": "the safe stop",
    "interior_point": "interior-point QPs",
}
MODELS: tuple[Model, ...] = ("online", "twice_info")


@dataclasses.dataclass(frozen=True)
class WorthConfig(SpreadConfig, RunConfig):
    """Which vehicles."""

    vehicles: int = 4
    noise_seeds: int = 1
    """Attempts of each vehicle."""
    population: Population = "held_out"
    vehicle_seed: int = 0
    """Of the draw of the vehicles."""


def rungs() -> list[Rung]:
    """The recipe, the recipe with one of them each, and with all of them."""

    def rung(name: str, what: str, keep: tuple[Extra, ...]) -> Rung:
        gathering = as_in_paper(GatheringConfig(), qp="stagewise" if "interior_point" in keep else "osqp")
        models = MODELS[:1] if keep == ("gate",) else MODELS
        return Rung(name, what, models, "paper", gathering, "euler", keep)

    return [
        rung("none", "as in the paper", ()),
        *(rung(name, f"with {WORDS[name]}", (name,)) for name in EXTRAS),
        rung("all", "with all of them", EXTRAS),
    ]


def main(config: WorthConfig) -> None:
    """Runs what is missing, then writes numbers and the tables."""
    folder = begun("worth", config)
    todo = rungs()
    options = dataclasses.asdict(config) | {"run_on": config.run_on, "models": MODELS}
    runs = drive_ladder(ImprovementsConfig(**options), todo, folder)
    write_table(runs, folder / "runs.csv", index=False)
    summary = summarise_ladder(runs)
    parts = [medians_table(todo, summary)]
    for model in MODELS:
        of_model = runs[runs["model"] == model]
        rows = [(one.what, *pair_of(of_model, "rung", one.name, "none")) for one in todo[1:] if model in one.models]
        parts.append(f"{LABELS[model]}, each less the recipe:\n\n{differences_table(rows)}")
    write_results(folder, config, summary, "\n\n".join(parts))


if __name__ == "__main__":
    run_command(main, WorthConfig, __doc__)
