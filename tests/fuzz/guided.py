"""Texts that someone else may have made, mutated by what they reach in the code (atheris, the engine of libFuzzer).

    python tests/fuzz/guided.py mapping -runs=20000

Inputs that reach something new are kept in `build/corpus/TARGET`. The first ones, and those that failed once, are in
`tests/fuzz/corpus/TARGET`: one that is neither taken nor refused in one sentence ends the run and is written there.
"""

import sys
import tempfile
import warnings
from pathlib import Path

import atheris

CODE = ["drift_drake.common", "drift_drake.gap.logs", "drift_drake.car", "drift_drake.gap.diagnosis.answers",
        "drift_drake.gap.identification.calibration"]  # fmt: skip
with atheris.instrument_imports(include=CODE):
    from corpus_targets import CORPUS, TARGETS

from drift_drake.common.errors import LONGEST_LINE, DriftDrakeError, one_line  # noqa: E402

BUILT = Path(__file__).parents[2] / "build" / "corpus"


def main(target: str, options: list[str]) -> None:
    """Runs libFuzzer with its options on a target, in this process."""
    ending, use = TARGETS[target]
    kept, first = BUILT / target, CORPUS / target
    kept.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"run_0{ending}" if ending == ".csv" else Path(folder) / f"import{ending}"

        def once(data: bytes) -> None:
            path.write_bytes(data)
            try:
                use(path)
            except DriftDrakeError as error:
                if not 0 < len(one_line(error)) < 2 * LONGEST_LINE:
                    raise ValueError("no sentence") from error

        limits = ["-timeout=20", "-rss_limit_mb=2048", "-max_len=20000", f"-artifact_prefix={first}/"]
        atheris.Setup([sys.argv[0], *limits, *options, str(kept), str(first)], once)
        atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
