"""Files of foreign formats: what crashes, hangs or fills the memory is one sentence, and the next file is read."""

import gzip
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hostile_readers import compute, crash, end, fill, refuse, wait, whose

from drift_drake.errors import DriftDrakeError
from drift_drake.logs import apart
from drift_drake.logs.apart import read_apart, read_guarded
from drift_drake.logs.bounds import is_small_text
from drift_drake.logs.importing.formats.files import InvalidRecordingError, read_topics
from drift_drake.logs.importing.look import look
from drift_drake.logs.table import InvalidLogError, read_columns


@pytest.fixture(autouse=True)
def _importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """`hostile_readers` is known to the process that reads, which is begun anew for it."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    apart._reader().end()


@pytest.mark.parametrize(
    ("function", "says"),
    [
        (crash, r"cannot be read \(its reader crashed: SIGSEGV\)"),
        (end, r"cannot be read \(its reader crashed: exit code 7\)"),
        (fill, r"cannot be read \(it takes more than 1\.1 GB of memory\)"),
        (compute, r"cannot be read \(it takes more than 0 s\)"),
        (wait, r"cannot be read \(it takes more than 0 s\)"),
        (refuse, "is not to my taste; give another"),
    ],
)
def test_whatever_reading_does_is_a_sentence_and_the_next_file_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, function: object, says: str
) -> None:
    path = tmp_path / "drive.bin"
    path.write_bytes(bytes(100))
    monkeypatch.setattr(apart, "SECONDS", 0.3)
    with pytest.raises(DriftDrakeError, match=f"drive.bin: {says}"):
        read_apart(function, path, InvalidLogError)  # type: ignore[arg-type]
    monkeypatch.setattr(apart, "SECONDS", 30.0)
    assert read_apart(whose, path, InvalidLogError) != os.getpid()


def test_one_process_reads_all_files(tmp_path: Path) -> None:
    assert read_apart(whose, tmp_path, InvalidLogError) == read_apart(whose, tmp_path, InvalidLogError)


def test_a_forked_process_has_a_reader_of_its_own(tmp_path: Path) -> None:
    reader = read_apart(whose, tmp_path, InvalidLogError)
    child = os.fork()
    if child == 0:
        os._exit(0 if read_apart(whose, tmp_path, InvalidLogError) not in (reader, os.getpid()) else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert read_apart(whose, tmp_path, InvalidLogError) == reader


def test_tables_that_come_from_there_can_be_written_to(tmp_path: Path) -> None:
    path = tmp_path / "drive.npz"
    np.savez(path, t=np.arange(100.0), v=np.ones(100))
    (topic,) = read_apart(read_topics, path, InvalidRecordingError)
    topic.table.loc[0, "v"] = 3.0
    assert topic.table["v"].sum() == 102.0


def test_text_of_moderate_size_is_read_here(tmp_path: Path) -> None:
    text = "t,v\n" + "0.01,12.0\n" * 100
    (tmp_path / "a.csv").write_text(text)
    (tmp_path / "b.csv").write_text(text, encoding="utf-16")
    with gzip.open(tmp_path / "c.csv.gz", "wb") as file:
        file.write(text.encode())
    for name in ("a.csv", "b.csv", "c.csv.gz"):
        assert is_small_text(tmp_path / name)
        assert read_guarded(whose, tmp_path / name, InvalidLogError) == os.getpid()
    (tmp_path / "wide.csv").write_text(",".join("a" * 20_000) + "\n")
    (tmp_path / "line.csv").write_text("," * (3 << 20))
    (tmp_path / "other.csv").write_bytes(b"MDF     4.10    \0\0")
    assert not any(is_small_text(tmp_path / name) for name in ("wide.csv", "line.csv", "other.csv"))


def bombs(folder: Path) -> list[Path]:
    """Small files that unpack, or claim, to gigabytes."""
    with gzip.open(folder / "run_0.csv.gz", "wb", 6) as file:
        file.write(b"t,r,v,delta_cmd\n")
        for _ in range(700):
            file.write(b"0.01,0.1,10,0.01\n" * 50_000)
    np.savez_compressed(folder / "zeros.npz", t=np.zeros(60_000_000, dtype=np.float64))
    paths = [folder / "run_0.csv.gz", folder / "zeros.npz"]
    h5py = pytest.importorskip("h5py", reason="an extra: pip install drift_drake[hdf5]")
    with h5py.File(folder / "claim.h5", "w") as file:
        file.create_dataset("claim", (10**8,), dtype="f8", chunks=(10**6,), compression="gzip")
    pd.DataFrame({name: np.zeros(13 * 10**6, dtype=np.int8) for name in ("t", "r", "v", "delta_cmd")}).to_parquet(
        folder / "run_1.parquet", compression="zstd"
    )
    return [*paths, folder / "claim.h5", folder / "run_1.parquet"]


def test_a_small_file_that_claims_much_is_refused_before_it_is_read(tmp_path: Path) -> None:
    for path in bombs(tmp_path):
        with pytest.raises(InvalidRecordingError, match=r"holds more than \d+ million numbers, or says so"):
            look(path)
        if path.name.startswith("run_"):
            with pytest.raises(InvalidLogError, match=r"holds more than \d+ million numbers, or says so"):
                read_columns(path)
