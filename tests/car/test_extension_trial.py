"""Extensions of another package are tried in a process with limits: one that does not end is named, once."""

from pathlib import Path

import pytest
from other_package import EFFECTS, install, install_package, run


@pytest.mark.parametrize(
    ("source", "jit", "how"),
    [
        ("while True:\n    pass\n", False, "takes more than 2 s"),
        ("import time\ntime.sleep(1e4)\n", False, "takes more than 2 s"),
        ("import os\nos._exit(0)\n", False, "ends Python (exit code 0)"),
        (
            "def force(r, v, beta, omega_r, psi, car, q):\n    while v < 0.0:\n        q = 0.0\n"
            "    return 0.0, q, 0.0\n",
            True,
            "takes more than 10 s",
        ),
    ],
)
def test_one_that_never_ends_is_named(tmp_path: Path, source: str, jit: bool, how: str) -> None:
    """When it is imported, or, once it is compiled, in a state that no call in Python has been in."""
    source += "from drift_drake import Effect\n" + (
        "" if jit else "force = lambda r, v, b, w, p, c, q: (0.0, q, 0.0)\n"
    )
    install_package(tmp_path, "endless", source + "GUST = Effect('N', -1.0, 1.0, 'a gust', force=force)\n", "effects",
                    {"gust": "GUST"})  # fmt: skip
    rests = 5.0 if "sleep" in source else 60.0
    program = (
        f"import drift_drake.car.effects.trial as trial\ntrial.SECONDS, trial.RESTS = {10 if jit else 2}, {rests}\n"
    )
    program += "from drift_drake.cli.main import main\nraise SystemExit(main(['effects']))\n"
    refused = run(tmp_path, "-c", program, jit=jit)
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (2, "", 1), refused.stderr
    assert f"effect gust (endless:GUST): {how}" in refused.stderr
    assert "let them end in every state" in refused.stderr


def test_that_they_end_is_seen_once(tmp_path: Path) -> None:
    install(tmp_path, EFFECTS)
    asked = "import drift_drake.car.effects.trial as trial\nasked = []\ntrial.subprocess.Popen = asked.append\n"
    asked += "from drift_drake import CATALOGUE\nassert not asked and 'side_wind' in CATALOGUE\n"
    assert run(tmp_path, "-c", "from drift_drake import CATALOGUE").returncode == 0
    assert run(tmp_path, "-c", asked).stderr == ""
