"""Plug-ins with flaws, each in a fresh Python that sees it."""

import os
import subprocess
import sys
import time
from random import Random

from as_command import Ended
from campaign_place import Place, Trial

PLUGIN = """from drift_drake import Effect
def force(r, v, beta, omega_r, psi, car, magnitude):
    {body}
{before}
E = Effect({fields})
"""
BODIES = [
    "return 0.0, magnitude * car.mass, 0.0",
    "return 0.0, 1.0",
    "return magnitude / r, 0.0, 0.0",
    "return 'a', 0.0, 0.0",
    "pass",
    "return 1e309, 0.0, 0.0",
    "raise ValueError('no')",
    "import os\n    return 0.0, 0.0, 0.0",
    "return car.nothing, 0.0, 0.0",
    "return (magnitude + 1j, 0.0, 0.0)",
    "while magnitude != 0.0:\n        pass\n    return 0.0, 0.0, 0.0",
]
BEFORE = [
    "",
    "",
    "",
    "import sys; sys.exit(0)",
    "print('hello')",
    "1 / 0",
    "raise SystemExit('x')",
    "import nothing_at_all",
    "raise BaseException",
    "raise RecursionError",
    "x = (",
]


def plug_ins(rng: Random, place: Place) -> Trial:
    """In a fresh Python, which sees the plug-in; a command of the campaign's own only where that went well."""
    fields = {"unit": "'m/s^2'", "low": "-1.0", "high": "1.0", "change": "'c'", "force": "force"}
    for name in rng.sample(sorted(fields), rng.choice([0, 0, 1, 2])):
        fields[name] = rng.choice(
            ["None", "float('nan')", "float('inf')", "'a'", "0", "1e400", "5.0", "()", "force", "10**400"]
        )
    name = rng.choice(
        ["side", "side", "side", "lambda", "none", "unknown", "mass", "steering_lag", "a b", "ü", "x" * 300, "1a"]
    )
    source = PLUGIN.format(
        body=rng.choice(BODIES), before=rng.choice(BEFORE), fields=", ".join(f"{k}={v}" for k, v in fields.items())
    )
    place.put("plug/evil-0.1.dist-info/METADATA", b"Metadata-Version: 2.1\nName: evil\nVersion: 0.1\n")
    place.put("plug/evil-0.1.dist-info/entry_points.txt", f"[drift_drake.effects]\n{name} = evil_plugin:E\n".encode())
    place.put("plug/evil_plugin.py", source.encode(), "plug_in")
    path = os.pathsep.join([str(place.folder / "plug"), *filter(None, [os.environ.get("PYTHONPATH")])])
    begun = time.monotonic()
    try:
        done = subprocess.run(
            [sys.executable, "-m", "drift_drake", "effects", "--json", "-"],
            cwd=place.folder,
            capture_output=True,
            text=True,
            timeout=120,
            env=os.environ | {"PYTHONPATH": path},
        )
        ended = Ended(done.returncode, done.stdout + done.stderr, time.monotonic() - begun)
    except subprocess.TimeoutExpired as error:
        ended = Ended(-9, str(error.stderr), 120.0, hung=True)
    if not ended.flaw and ended.code == 0 and not done.stdout.startswith("{"):
        ended = Ended(1, "standard output is not free: " + ended.said[:300], ended.seconds)
    yield ended  # type: ignore[misc]
