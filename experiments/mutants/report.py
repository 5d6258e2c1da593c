"""The report: killed, survived and equivalent mutants by part, and each survivor's change."""

import re
from pathlib import Path

import pandas as pd
import yaml
from cosmic_ray.work_db import WorkDB
from cosmic_ray.work_item import TestOutcome

from experiments.mutants.sample import PARTS, part_of

TOO_LONG = "too long"
EQUIVALENT = Path(__file__).with_name("equivalent.yaml")
"""Mutants that no test can tell from the original: module, line before, line after, why."""


def changed_lines(diff: str) -> tuple[str, str]:
    """The line before and after a mutation, without indentation."""
    lines = diff.split("\n")
    gone = [line[1:].strip() for line in lines if line.startswith("-") and not line.startswith("---")]
    new = [line[1:].strip() for line in lines if line.startswith("+") and not line.startswith("+++")]
    return " ".join(gone), " ".join(new)


def equivalents() -> dict[tuple[str, str, str], str]:
    """Why a mutant is equivalent, by module, line before and line after."""
    listed = yaml.safe_load(EQUIVALENT.read_text(encoding="utf-8")) if EQUIVALENT.exists() else []
    return {(entry["module"], entry["before"], entry["after"]): entry["why"] for entry in listed or []}


def write_report(work: WorkDB, tree: Path, path: Path) -> str:
    """Writes the report; returns its table."""
    known, rows = equivalents(), []
    for item, result in work.completed_work_items:
        module = str(item.mutations[0].module_path.relative_to(tree / "drift_drake").with_suffix(""))
        before, after = changed_lines(result.diff or "")
        outcome = "survived" if result.test_outcome == TestOutcome.SURVIVED else "killed"
        if outcome == "killed" and result.output == TOO_LONG:
            outcome = "too long"
        why = known.get((module, before, after), "")
        if outcome == "survived" and not re.search(r"\d passed", result.output or ""):
            outcome = "no test"
        if outcome in ("survived", "no test") and why:
            outcome = "equivalent"
        line = item.mutations[0].start_pos[0]
        rows.append((part_of(module), outcome, f"{module}:{line}", before, after, why))
    columns = ["part", "outcome", "place", "before", "after", "why"]
    frame = pd.DataFrame(rows, columns=columns)
    kinds = ["killed", "too long", "no test", "survived", "equivalent"]
    counts = frame.groupby(["part", "outcome"]).size().unstack(fill_value=0).reindex(columns=kinds, fill_value=0)
    counts = counts.reindex([part for part in PARTS if part in counts.index])
    counts.loc["all"] = counts.sum()
    judged = counts["killed"] + counts["survived"]
    share = (100.0 * counts["survived"] / judged.where(judged > 0, 1)).round(1)
    head = (
        "| part | killed | too long | no test | survived | equivalent | survived, % |\n|---|---|---|---|---|---|---|\n"
    )
    table = head + "".join(
        f"| {part} | " + " | ".join(str(counts.loc[part, kind]) for kind in kinds) + f" | {share[part]} |\n"
        for part in counts.index
    )
    text = table
    for outcome in ("survived", "no test", "too long", "equivalent"):
        text += f"\n## {outcome}\n\n"
        for _, row in frame[frame["outcome"] == outcome].sort_values("place").iterrows():
            text += f"- {row['place']}\n  - `{row['before']}`\n  + `{row['after']}`\n" + (
                f"  {row['why']}\n" if row["why"] else ""
            )
    path.write_text(text, encoding="utf-8")
    return table
