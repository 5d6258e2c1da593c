"""Which format a file has, by its first bytes where they say so, else by its ending; and formats that are not read."""

import re
from pathlib import Path
from typing import NamedTuple


class Refused(NamedTuple):
    """A format that is not read: its name, the way to one that is, its files' endings, how their first bytes look."""

    name: str
    way: str
    endings: tuple[str, ...] = ()
    magic: bytes = b""


OWN_CSV = "export it as CSV with the maker's software"
SHEET = "save the sheet as CSV"
MOTEC = "export it from MoTeC i2 as CSV (File, Export)"
TO_VBO = "convert it to .vbo with VBOX Test Suite"
GPSBABEL = "convert it to CSV with gpsbabel -o unicsv"
MAVLINK = "convert it with mavlogdump.py --format csv"
DEWESOFT = "export it from DewesoftX as MDF4, MATLAB or CSV"
PANDAS = "write it as Parquet: pandas.read_feather(FILE).to_parquet(NEW)"
NAMED = "save named arrays: numpy.savez('run.npz', t=..., v=..., r=...)"

REFUSED = (
    Refused("MoTeC .ld", MOTEC, (".ld",), rb"\x40\x00{7}.{8}\x00{20}"),
    Refused("MoTeC .ldx, which holds the laps of an .ld", MOTEC.replace("it", "the .ld", 1), (".ldx",)),
    Refused("AiM .drk", "open it in RaceStudio and export it as CSV, or give the .xrk", (".drk",)),
    Refused("VBOX .vbb", TO_VBO, (".vbb",)),
    Refused("VBOX .vbs", TO_VBO, (".vbs",)),
    Refused("a RaceChrono session", "export it from RaceChrono as CSV or .vbo", (".rcz", ".rcb")),
    Refused("iRacing .ibt", "convert it to CSV (MoTeC i2, or pyirsdk)", (".ibt",)),
    Refused("Bosch WinDarab", OWN_CSV, (".bmsbin",)),
    Refused("Cosworth Pi", OWN_CSV, (".pds",)),
    Refused("imc", OWN_CSV, (".dat3",)),
    Refused("Dewesoft", DEWESOFT, (".dxd", ".d7d")),
    Refused("IPG CarMaker .erg", "export it from IPGControl as MATLAB or CSV", (".erg",)),
    Refused("CarSim", "write its outputs as CSV or .mat", (".vs",)),
    Refused("a MAVLink .tlog", MAVLINK, (".tlog",)),
    Refused("ArduPilot's DataFlash .bin", MAVLINK, (), rb"\xa3\x95\x80\x80"),
    Refused("a Betaflight blackbox", "convert it with blackbox_decode to CSV", (".bbl",), rb"H Product:Blackbox"),
    Refused("TDMS of National Instruments", "export it as CSV, or as HDF5 with npTDMS", (".tdms",), rb"TDSm"),
    Refused("an Excel workbook", SHEET, (".xlsx", ".xlsm"), rb"PK\x03\x04.*\[Content_Types\]"),
    Refused("an old Excel workbook", SHEET, (".xls",), rb"\xd0\xcf\x11\xe0"),
    Refused("a spreadsheet", SHEET, (".ods",)),
    Refused("a zip", "unpack it", (), rb"PK\x03\x04"),
    Refused("Garmin .fit", "convert it to CSV with FitCSVTool", (".fit",), rb".{8}\.FIT"),
    Refused("GPX", GPSBABEL, (".gpx",), rb"\s*(<\?xml[^>]*>\s*(<!--.*?-->\s*)?)?<gpx"),
    Refused("KML", GPSBABEL, (".kmz",), rb"\s*(<\?xml[^>]*>\s*(<!--.*?-->\s*)?)?<kml"),
    Refused("NMEA sentences", GPSBABEL.replace("it", "them", 1), (), rb"\$G[A-Z]{4},"),
    Refused("a Python pickle, which may run code when it is read", "write it as CSV or .npz", (".pkl", ".pickle"),
            rb"\x80[\x02-\x05][\x95}\]K(c]"),
    Refused(".npy, an array without names", NAMED, (".npy",), rb"\x93NUMPY"),
    Refused("JSON", "write its readings as CSV: pandas.read_json(FILE, lines=True).to_csv(NEW)",
            (".json", ".jsonl", ".ndjson"), rb'\s*[\[{]\s*[\[{"]'),
    Refused("Feather", PANDAS, (".feather",)),
    Refused("Arrow or Feather", PANDAS, (), rb"ARROW1|FEA1"),
    Refused("an SQLite database", "export its table as CSV", (), rb"SQLite format 3\0"),
    Refused("a database of CAN messages and no recording", "give the log of frames, with --dbc FILE", (".dbc",)),
)  # fmt: skip


class Format(NamedTuple):
    """A format: module and function that read it, what it is called, the extra that it needs, and whether the reader
    takes databases of CAN messages."""

    module: str
    function: str
    title: str
    extra: str = ""
    databases: bool = False


CSV = Format("text_tables", "read_csv", "CSV")
PARQUET = Format("text_tables", "read_parquet", "Parquet", "parquet")
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
