"""What a file may hold, seen before it is read: a kilobyte may claim gigabytes."""

import bz2
import contextlib
import gzip
import lzma
import stat
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

PIECE = 1 << 20  # bytes
LARGEST_TEXT = 100 * PIECE  # bytes, unpacked, that are read without further care
MOST_COLUMNS = 10_000  # of a table that is
MOST_NUMBERS = 50_000_000  # in a file, and one more for each of its bytes: five hours of 28 columns at 100 Hz
BYTES_OF_NUMBER = 8
BINARY = (b"LOGG", b"MDF ", b"UnFinMF", b"ULog", b"MATLAB", b"<hCNF", b"#ROSBAG")  # formats that begin with letters
CONTROL = bytes([0, 1, 2, 3, 4, 5, 6, 14, 15, 16, 17, 18, 19])
ODD = 0.3  # share of letters beyond ASCII in a text that is not UTF-8
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
GZIP, PARQUET, HDF5, ZIP, BZIP2, XZ = b"\x1f\x8b", b"PAR1", b"\x89HDF\r\n\x1a\n", b"PK\x03\x04", b"BZh", b"\xfd7zXZ"
STREAMS: dict[bytes, Callable[[Path], IO[bytes]]] = {GZIP: gzip.open, BZIP2: bz2.open, XZ: lzma.open}  # type: ignore[dict-item]
PACKINGS = {GZIP: "gzip", BZIP2: "bz2", XZ: "xz"}  # as pandas names them


def packing(path: Path) -> bytes:
    """The first bytes that say how a file is packed, whatever it is called; none where it is not."""
    with path.open("rb") as file:
        first = file.read(max(map(len, STREAMS)))
    return next((magic for magic in STREAMS if first.startswith(magic)), b"")


def is_small_text(path: Path) -> bool:
    """Whether a file is a text of moderate size and not absurdly wide, packed by gzip or not."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > LARGEST_TEXT:
            return False
        with path.open("rb") as file:
            packed = file.read(len(GZIP)) == GZIP
        with STREAMS[GZIP](path) if packed else path.open("rb") as stream:
            first = stream.read(PIECE)
            if not first.startswith(UTF_16) and _is_binary(first[:4096]):
                return False
            if not packed or len(first) < PIECE:
                return _narrow(first)
            return _narrow(first) and _unpacked(stream, LARGEST_TEXT - PIECE) <= LARGEST_TEXT - PIECE
    except (OSError, ValueError, EOFError, zlib.error):
        return True  # there is none, or it is cut: the reader says so


def _is_binary(first: bytes) -> bool:
    """Whether first bytes are no text's: they have a binary format's mark, signs of control, or mostly odd letters."""
    if first.startswith(BINARY) or any(byte in first for byte in CONTROL):
        return True
    return sum(byte > 0x7F for byte in first) > ODD * len(first) and first.decode("utf-8", "ignore").encode() != first


def check_claims(path: Path) -> None:
    """Sees that what a file says it holds can be: numbers of Parquet, HDF5, .npz, bytes of packed text.

    Raises:
        ValueError: it claims more; whatever the formats' libraries raise on a damaged file is left to the reader.
    """
    if not path.is_file():
        return
    with path.open("rb") as file:
        head = file.read(8)
    most = MOST_NUMBERS + path.stat().st_size
    numbers = 0.0
    with contextlib.suppress(Exception):
        numbers = _claimed(path, head, most)
    if numbers > most:
        raise ValueError(f"it holds more than {most / 1e6:.0f} million numbers, or says so")


def _claimed(path: Path, head: bytes, most: float) -> float:
    """How many numbers a file claims to hold; 0 where its head does not say."""
    if head.startswith(PARQUET):
        from pyarrow.parquet import read_metadata

        footer = read_metadata(path)
        return float(footer.num_rows) * footer.num_columns
    if head == HDF5 or head == b"MATLAB 7":
        return _of_hdf5(path)
    if head.startswith(ZIP):
        with zipfile.ZipFile(path) as file:
            return sum(entry.file_size for entry in file.infolist()) / BYTES_OF_NUMBER
    for magic, opened in STREAMS.items():
        if head.startswith(magic):
            with opened(path) as stream:
                return _unpacked(stream, BYTES_OF_NUMBER * most) / BYTES_OF_NUMBER
    return 0.0


def _of_hdf5(path: Path) -> float:
    import h5py

    sizes: list[float] = []

    def visit(_name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.size:
            sizes.append(float(item.size) * max(item.dtype.itemsize / BYTES_OF_NUMBER, 1.0))

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return sum(sizes)


def _unpacked(stream: IO[bytes], most: float) -> float:
    """Bytes that are left in a stream, read in pieces until they are more than `most`."""
    count = 0
    while count <= most and (piece := stream.read(PIECE)):
        count += len(piece)
    return count


def _narrow(first: bytes) -> bool:
    """Whether a text's first line ends within its first piece, with no more than `MOST_COLUMNS` cells."""
    if len(first) == PIECE and b"\n" not in first and b"\r" not in first:
        return False
    line = first.split(b"\n", 1)[0]
    return max(line.count(mark) for mark in (b",", b";", b"\t")) < MOST_COLUMNS
