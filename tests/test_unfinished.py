"""What a kill -9 leaves of unfinished files is removed by the next process that writes there, what lives is not."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from drift_drake.common.safe_files import PARTIAL, remove_left_behind, try_folder, unfinished_folder, write_text

WRITER = """
import sys, time
from drift_drake.common.safe_files import replacing

with replacing(sys.argv[1]) as part:
    part.write_text("half")
    print("ready", flush=True)
    time.sleep(60.0)
"""


def unfinished(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith(PARTIAL)]


def test_only_what_no_process_writes_is_removed(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "before")
    kept = [tmp_path / ".part-mine", tmp_path / ".part-0123abcd"]
    kept[0].mkdir()
    kept[1].symlink_to(kept[0])
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(tmp_path / "a.txt")], env=environment,
                              stdout=subprocess.PIPE, text=True)  # fmt: skip
    try:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "ready\n"
        remove_left_behind.cache_clear()
        write_text(tmp_path / "b.txt", "text")
        assert len(unfinished(tmp_path)) == len(kept) + 1
    finally:
        writer.kill()
        writer.communicate()
    assert len(unfinished(tmp_path)) == len(kept) + 1
    remove_left_behind.cache_clear()
    try_folder(tmp_path, "--json")
    assert sorted(unfinished(tmp_path)) == sorted(path.name for path in kept)
    assert (tmp_path / "a.txt").read_text() == "before"


def test_writers_do_not_remove_one_anothers_folders(tmp_path: Path) -> None:
    def write(number: int) -> bool:
        for _ in range(50):
            remove_left_behind.cache_clear()
            with unfinished_folder(tmp_path) as folder:
                (folder / "x").write_text(str(number))
                if (folder / "x").read_text() != str(number):
                    return False
        return True

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(write, range(4)))
    assert not unfinished(tmp_path)
