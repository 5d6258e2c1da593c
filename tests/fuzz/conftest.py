"""The number of inputs that were tried, by target."""

import sys
from typing import Any


def pytest_terminal_summary(terminalreporter: Any) -> None:
    fuzzing = sys.modules.get("fuzzing")  # not imported where Hypothesis is missing
    if fuzzing is None or not fuzzing.COUNTS:
        return
    terminalreporter.section("fuzzed inputs")
    for target, counts in fuzzing.COUNTS.items():
        terminalreporter.line(f"{target:<28}" + ", ".join(f"{count} {what}" for what, count in counts.items()))
    total = sum(counts["tried"] for counts in fuzzing.COUNTS.values())
    terminalreporter.line(f"{'all':<28}{total} tried")
