"""Compiled functions: processes that need one at the same time compile it once."""

import os
import subprocess
import sys

SOURCE = """
import sys
from drift_drake.compilation import compiled

@compiled
def inner(x):
    total = 0.0
    for i in range(10):
        total += x**i
    return total

@compiled
def outer(x):
    return inner(x) + inner(2.0 * x)

print("ready", flush=True)
sys.stdin.readline()
outer(0.5)
print(sum(outer.stats.cache_misses.values()), sum(inner.stats.cache_misses.values()), outer(0.5))
"""


def test_two_processes_compile_a_function_once(tmp_path):
    (tmp_path / "shared.py").write_text(SOURCE)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}
    both = [
        subprocess.Popen([sys.executable, "shared.py"], cwd=tmp_path, env=environment, text=True,
                         stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for _ in range(2)
    ]  # fmt: skip
    for process in both:
        assert process.stdout.readline() == "ready\n"
    for process in both:
        process.stdin.write("\n")
        process.stdin.flush()
    said = [process.communicate() for process in both]
    assert [errors for _, errors in said] == ["", ""]
    outer, inner, results = zip(*(line.split() for line, _ in said), strict=True)
    assert sorted(outer) == ["0", "1"]
    assert sum(map(int, inner)) <= 1  # the process that finds `outer` on the disk needs no `inner`
    assert results[0] == results[1]
