"""Files of foreign formats: what crashes, hangs or fills the memory is one sentence, and the next file is read."""

import bz2
import gzip
import lzma
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hostile_readers import compute, crash, end, fill, length, refuse, wait, whose

from drift_drake.car.log.table import InvalidLogError, read_columns, read_run
from drift_drake.common import apart, bounds
from drift_drake.common.apart import read_apart, read_guarded
from drift_drake.common.bounds import check_claims, is_small_text
from drift_drake.common.errors import DriftDrakeError
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError, read_topics
from drift_drake.gap.logs.importing.look import look


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


def test_a_relative_path_is_of_the_folder_that_one_is_in_now(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, count in (("one", 10), ("two", 20)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "drive.bin").write_bytes(bytes(count))
        monkeypatch.chdir(tmp_path / name)
        assert read_apart(length, Path("drive.bin"), InvalidLogError) == count


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
    (tmp_path / "umlauts.csv").write_bytes("t,Gierrate [°/s],größe\n".encode("cp1252"))
    (tmp_path / "japanese.csv").write_text("時間,速度,角度\n" * 100, encoding="utf-8")
    assert all(is_small_text(tmp_path / name) for name in ("umlauts.csv", "japanese.csv"))
    # Of letters and odd bytes alone, whose lengths claim gigabytes.
    for content in (b"LOGGxxxxxxxx" * 20, b"\xff" * 300, b"a,b\n\x01\x02"):
        (tmp_path / "binary.blf").write_bytes(content)
        assert not is_small_text(tmp_path / "binary.blf")


def bombs(folder: Path) -> list[Path]:
    """Small files that unpack, or claim, to more than they should."""
    for name, opened in (("a.csv.gz", gzip.open), ("a.csv.bz2", bz2.open), ("a.csv.xz", lzma.open)):
        with opened(folder / name, "wb") as file:
            file.write(b"0.01,0.1,10,0.01\n" * 60_000)
    np.savez_compressed(folder / "a.npz", t=np.zeros(200_000))
    pd.DataFrame({name: np.zeros(40_000) for name in ("t", "r", "v", "delta_cmd")}).to_parquet(folder / "a.parquet")
    return [*folder.iterdir(), claim(folder)]


def claim(folder: Path) -> Path:
    h5py = pytest.importorskip("h5py", reason="an extra: pip install drift_drake[hdf5]")
    with h5py.File(folder / "claim.h5", "w") as file:
        file.create_dataset("claim", (10**8,), dtype="f8", chunks=(10**6,), compression="gzip")
    return folder / "claim.h5"


def test_what_a_small_file_claims_is_seen_before_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = bombs(tmp_path)
    for path in paths[:-1]:
        check_claims(path)
    monkeypatch.setattr(bounds, "MOST_NUMBERS", 100_000)
    for path in paths:
        with pytest.raises(ValueError, match=r"it holds more than \d+ million numbers, or says so"):
            check_claims(path)


def test_a_kilobyte_that_claims_a_gigabyte_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InvalidRecordingError, match=r"claim\.h5: cannot be read \(it holds more than 50 million numbers"
    ):
        look(claim(tmp_path))


def test_a_run_in_parquet_is_read_apart_as_it_was(tmp_path: Path) -> None:
    t = 0.01 * np.arange(60)
    table = pd.DataFrame({"t": t, "r": 0.1 * t, "v": 10.0 + t, "delta_cmd": 0.0 * t, "note": ["text"] * 60})
    table.to_parquet(tmp_path / "run_0.parquet")
    columns = read_columns(tmp_path / "run_0.parquet")
    assert list(columns) == ["t", "r", "v", "delta_cmd"]
    np.testing.assert_array_equal(columns["v"], 10.0 + t)
    table.drop(columns="v").to_parquet(tmp_path / "run_1.parquet")
    with pytest.raises(InvalidLogError, match=r"run_1\.parquet: missing column v"):
        read_run(tmp_path / "run_1.parquet")
