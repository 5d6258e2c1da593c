"""An answer as one row of a table of many (`results_table`)."""

from typing import Any

from drift_drake.diagnosis.answers.answer import Answer


def answer_row(answer: Answer) -> dict[str, Any]:
    """Verdict, its probability, share of the gap removed, and of each cause its magnitude with a 95 % interval."""
    causes = "+".join(sorted(answer.causes))
    row = {
        "case": answer.case,
        "verdict": answer.verdict,
        "causes": causes,
        "probability": answer.posterior.get(causes or answer.verdict),
        "reduction": answer.reduction.estimate,
        "reduction_low": answer.reduction.low,
        "reduction_high": answer.reduction.high,
        "warnings": len(answer.warnings),
        "seconds": answer.seconds,
    }
    for name, magnitude in answer.magnitudes.items():
        row |= {name: magnitude.estimate, f"{name}_low": magnitude.low, f"{name}_high": magnitude.high}
    return row
