"""Every claim, table and figure of the paper, with what came out here.

    python -m experiments.paper                                        # 20 vehicles: hours on two cores
    python -m experiments.paper --parts drives figure_8 --vehicles 6   # some parts, fewer vehicles
    python -m experiments.paper --executor dask --scheduler tcp://HOST:8786

Parts: drives (information gathering, Table I), figure_8 (Tables II and III), loops, steps (recipe to shipped model, one
change at a time), worth (what the paper has not, one at a time), figures (of one vehicle). All run under the paper's
recipe and as shipped, each in a folder of its own that is gone on with (give --out): more vehicles and seeds join
those that are there. Written: claims.md, with the verdict of each claim by its data, the tables, and the figures.
"""

from pathlib import Path

from diagrams.command import run_command
from drift_drake.common.run_folder import make_run_folder, write_json
from drift_drake.common.safe_files import write_text
from experiments.made import made
from experiments.paper import figures, tables
from experiments.paper.claims import claims_table, evidence
from experiments.paper.parts import KINDS, PaperConfig, run_parts
from experiments.paper.verdicts import FEWEST, MARGIN, RELIABLE
from experiments.settings import keep_settings

RULES = (
    "Each figure is over the vehicles that were run, a simulated car each, with 95 % intervals by vehicle. A claim "
    f"*holds* where the whole interval does: a share above {RELIABLE:.0%}, a difference above 0, a ratio above 1 "
    "(in the rows of the abstract's claim (ii), fewer runs completed or an RMS error above "
    f"{MARGIN:g} times Twice-Info's). It *does not hold* where no part of the interval does. It is *not shown* "
    f"otherwise, and by fewer than {FEWEST} vehicles. A run that was not completed is infinitely far off. No verdict "
    "is written by hand."
)


def page(folder: Path, config: PaperConfig) -> str:
    """claims.md."""
    found = {kind: evidence(folder, kind) for kind in KINDS}
    captions = folder / "figures" / "captions.md"
    if "figures" in config.parts:
        figures.draw_all(folder, config, found)
    parts = [
        "# Claims",
        RULES,
        claims_table(found),
        *_section("Table I, by state", tables.norms(found)),
        *_section("Tables II and III", tables.best_and_worst(found)),
        *_section("Where the figure-8 failed", tables.failures(found)),
        *_section("Weights, objective, narrowed lane", tables.bolder(folder)),
        *_section("Claim (ii), from the recipe to the shipped model", tables.steps(folder)),
        *_section("What the paper has not, one at a time", _report(folder / "worth")),
        *_section("Figures", captions.read_text() if captions.exists() else ""),
        made(config),
    ]
    return "\n\n".join(parts) + "\n"


def _section(title: str, text: str) -> list[str]:
    return [f"## {title}", text] if text else []


def _report(folder: Path) -> str:
    """The tables of a part's own report, without how they were made."""
    file = folder / "report.md"
    return file.read_text().split("\n\nMade on ")[0] if file.exists() else ""


def main(config: PaperConfig) -> None:
    """Runs the parts, then writes the page."""
    folder = make_run_folder("paper", config.out)
    settings = {name: getattr(config, name) for name in ("population", "vehicle_seed", "rebuild")}
    keep_settings(folder, settings, ())
    run_parts(config, folder)
    write_text(folder / "claims.md", page(folder, config))
    write_json(folder / "command.json", config)
    print(f"results in {folder / 'claims.md'}")


if __name__ == "__main__":
    run_command(main, PaperConfig, __doc__)
