"""Drifts the figure-8 with each of the controllers' models on vehicles that no model was trained on (section IV-B).

    python -m experiments.drifting.figure_8
    python -m experiments.drifting.figure_8 --as-in-paper
    python -m experiments.drifting.figure_8 --models prior online twice_online --noise-seeds 1 --out runs/online

The closed loop at 100 Hz, from a start in the drift as after the paper's hand-brake; see `drifting.runs` for
the models, `common.executors` for clusters. Written: config.json, runs.csv, results.parquet (the same, where
pyarrow is installed), numbers.json, report.md (the paper's Tables II and III and ours), time_series.png,
overhead.png. Broken off, it goes on where it was (give --out).
"""

from diagrams.command import run_command
from drift_drake.common.run_folder import write_results_table
from experiments.drifting.report import (
    choice_sentence,
    completion_table,
    draw,
    ordering_table,
    over_oracle_table,
    paper_table,
    picture_sentence,
    plans_sentence,
    refusal_sentence,
    summarise,
)
from experiments.drifting.runs import ModelsConfig, opened, reference, run_models
from experiments.made import write_results


def main(config: ModelsConfig) -> None:
    """Runs what is missing, then writes numbers and pictures."""
    config = config.resolved()
    folder = opened("figure_8", config)
    runs = run_models(config, "figure_8", folder)
    write_results_table(folder, runs)
    summary = summarise(runs)
    report = (
        f"{completion_table(summary)}\n\n{ordering_table(runs)}{over_oracle_table(runs)}{refusal_sentence(summary)}"
        f"{choice_sentence(runs)}{plans_sentence(summary)}{picture_sentence(runs)}"
        f"Table II, RMS lateral deviation [m] (here: medians over the vehicles)\n\n{paper_table(summary, 'rms_e')}\n\n"
        "Table III, RMS sideslip error [rad], truncated before a spin\n\n"
        f"{paper_table(summary, 'rms_sideslip_error')}\n"
    )
    write_results(folder, config, summary, report)
    draw(folder, runs, reference("figure_8"))


if __name__ == "__main__":
    run_command(main, ModelsConfig)
