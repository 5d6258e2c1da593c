"""Scores of real logs: with changes put in by hand, and as they are."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from drift_drake.common.run_folder import write_json
from experiments.made import tabulated
from experiments.other_worlds.scoring import Row, all_scores, scores_text


def reason(row: Row) -> str:
    """What was said of a case, with what is behind it, in one line."""
    a = row.answer
    if row.failed:
        return f"{row.said}: {a['message']}"
    leading = ", ".join(f"{name} {p:.2f}" for name, p in sorted(a["posterior"].items(), key=lambda item: -item[1])[:3])
    found = ", ".join(f"{name} {m['estimate']:.3g} ({m['low']:.3g} to {m['high']:.3g})"
                      for name, m in a["magnitudes"].items())  # fmt: skip
    nats = ", ".join(f"{name} {q:.1f}" for name, q in a["details"].get("nats_from_normal", {}).items())
    near = a["details"].get("nearest") or {}
    parts = [leading, found, f"nats from normal: {nats}" if nats else ""]
    if found:
        parts.append(f"removes {a['reduction']['estimate']:.2f}")
    if near:
        parts.append(f"nearest {near['hypothesis']}, removes {near['removes']:.2f}")
    return "; ".join(part for part in parts if part)


def hand_text(rows: Sequence[Row], skipped: dict[str, dict[str, str]]) -> str:
    """Every case as a row of a table, those as they are first; then what could not be put in."""
    as_they_are = [(f"{row.world}: {row.case}", row.said, reason(row), "; ".join(row.answer["warnings"]))
                   for row in rows if not row.effects]  # fmt: skip
    changed = []
    for row in rows:
        for name, q in row.effects.items():
            holds = {(): "-", (True,): "yes", (False,): "no"}[tuple(row.covered)]
            held = "yes" if row.held else "no"
            changed.append((f"{row.world}: {name}", f"{q:.3g}", row.said, held, holds, reason(row)))
    heads = ("change by hand", "magnitude", "said", "in the ambiguity set", "interval holds it", "why")
    lines = [*tabulated(("logs as they are", "said", "why", "warnings"), as_they_are), "", *tabulated(heads, changed)]
    lines += [""] + [f"- {study}: no {name}, {why}" for study, names in skipped.items() for name, why in names.items()]
    return "\n".join(lines) + "\n"


def write_scores(
    rows: Sequence[Row], skipped: dict[str, dict[str, str]], more: dict[str, Any], text: str, folder: Path
) -> None:
    """scores.json and scores.md."""
    # Every change is of the same size, by the limits of the logs as they are; a change moves its own logs' limits.
    result = all_scores(rows) | {"by size": {}}
    write_json(folder / "scores.json", result | {"not put in": skipped} | more)
    (folder / "scores.md").write_text("\n".join([hand_text(rows, skipped), scores_text(result), text]))
