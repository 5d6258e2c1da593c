"""Which format a file has, by its first bytes where they say so, else by its ending; and formats that are not read."""

import re
from pathlib import Path
from typing import NamedTuple

from drift_drake.gap.logs.importing.formats.refused_formats import REFUSED


class Format(NamedTuple):
    """A format: module and function that read it, what it is called, the extra that it needs, and whether the reader
    takes databases of CAN messages."""

    module: str
    function: str
    title: str
    extra: str = ""
    databases: bool = False


CSV = Format("text_tables", "read_csv", "CSV")
PARQUET = Format("tables", "read_parquet", "Parquet", "parquet")
MCAP = Format("topics", "read_mcap", "MCAP", "ros")
BAG = Format("topics", "read_bag", "ROS bags", "ros")
MDF = Format("mdf", "read_mdf", "MDF", "mdf", True)
MAT = Format("matlab", "read_mat", "MATLAB files", "matlab")
NPZ = Format("arrays", "read_npz", "npz")
HDF5 = Format("arrays", "read_hdf5", "HDF5", "hdf5")
VBO = Format("vbo", "read_vbo", "VBOX .vbo")
XRK = Format("aim", "read_xrk", "AiM .xrk", "aim")
ULOG = Format("ulog", "read_ulog", "PX4 .ulg", "px4")
CAN = Format("can_frames", "read_can", "CAN frames", "can", True)

ENDINGS = {
    ".csv": CSV, ".parquet": PARQUET, ".mcap": MCAP, ".bag": BAG, ".db3": BAG, ".mf4": MDF, ".mdf": MDF, ".mat": MAT,
    ".npz": NPZ, ".h5": HDF5, ".hdf5": HDF5, ".vbo": VBO, ".xrk": XRK, ".xrz": XRK, ".ulg": ULOG, ".blf": CAN,
}  # fmt: skip
MAGIC = (
    (rb"MDF     |UnFinMF ", MDF), (rb"\x89HDF\r\n\x1a\n", HDF5), (rb"MATLAB \d", MAT), (rb"PAR1", PARQUET),
    (rb"\x89MCAP0\r\n", MCAP), (rb"#ROSBAG V", BAG), (rb"ULog\x01\x12\x35", ULOG), (rb"LOGG", CAN), (rb"<hCNF", XRK),
)  # fmt: skip
# Frames in text: Vector's, PEAK's, and candump's as it is written to a file or shown.
FRAMES = (
    rb"\s*date [^\n]*\n(//[^\n]*\n|\s*\n)*\s*base (hex|dec)\b",
    rb"\s*;\s*\$FILEVERSION=",
    rb"\s*\([\d.:\- ]+\)\s+\S+\s+[0-9A-Fa-f]{3,8}(#|\s+\[\d+\])",
    rb"\s*\S+\s+[0-9A-F]{3,8}\s+\[\d+\]\s+([0-9A-F]{2} ?)*\s*\n",
)
SECTIONS = rb"(^|\n)\s*\[(column names|data|header)\]\s*\r?\n"
LEAD = 4096  # bytes that are looked at
PACKED = (".zip", ".gz", ".bz2", ".xz", ".zst", ".tar", ".tgz")


def format_of(path: Path) -> Format:
    """The format of a file; text that nothing else is known of is taken for CSV."""
    lead, ending = _lead(path), path.suffix.lower()
    for pattern, found in MAGIC:
        if re.match(pattern, lead):
            return found
    if ending in ENDINGS:
        return ENDINGS[ending]
    if any(re.match(pattern, lead) for pattern in FRAMES):
        return CAN
    names = {name.lower() for _, name in re.findall(SECTIONS, lead, re.IGNORECASE)}
    return VBO if {b"column names", b"data"} <= names else CSV


def refused(path: Path) -> tuple[str, str] | None:
    """Name of a format that is not read, and the way to one that is; None of any other file."""
    lead, ending = _lead(path), path.suffix.lower()
    if (ending in ENDINGS and ending != ".csv") or any(re.match(pattern, lead) for pattern, _ in MAGIC):
        return None
    by_ending = (form for form in REFUSED if ending in form.endings)
    by_bytes = (form for form in REFUSED if form.magic and re.match(form.magic, lead, re.DOTALL))
    found = next(by_ending, None) or (None if ending in PACKED else next(by_bytes, None))
    return None if found is None else (found.name, found.way)


def _lead(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.read(LEAD)
