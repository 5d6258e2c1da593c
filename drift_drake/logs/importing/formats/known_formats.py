"""Which format a file has, by its first bytes where they say so, else by its ending; and formats that are not read."""

import re
from pathlib import Path
from typing import NamedTuple


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
OWN_CSV = "export it as CSV with the maker's software"
PACKED = (".zip", ".gz", ".bz2", ".xz", ".zst", ".tar", ".tgz")

REFUSED_MAGIC = (
    (rb"\x40\x00{7}.{8}\x00{20}", "MoTeC .ld", "export it from MoTeC i2 as CSV (File, Export)"),
    (rb"\xd0\xcf\x11\xe0", "an old Excel workbook", "save the sheet as CSV"),
    (rb"TDSm", "TDMS of National Instruments", "export it as CSV, or convert it to HDF5 with npTDMS"),
    (rb"\xa3\x95\x80\x80", "ArduPilot's DataFlash .bin", "convert it with mavlogdump.py --format csv"),
    (rb"H Product:Blackbox", "a Betaflight blackbox", "convert it with blackbox_decode to CSV"),
    (rb"ARROW1|FEA1", "Arrow or Feather", "write it as Parquet: pandas.read_feather(FILE).to_parquet(NEW)"),
    (rb"\x93NUMPY", ".npy, an array without names", "save named arrays: numpy.savez('run.npz', t=..., v=..., r=...)"),
    (rb"\x80[\x02-\x05][\x95}\]K(c]", "a Python pickle, which may run code when it is read", "write it as CSV or .npz"),
    (rb".{8}\.FIT", "Garmin .fit", "convert it to CSV with FitCSVTool"),
    (rb"\$G[A-Z]{4},", "NMEA sentences", "convert them to CSV (time, latitude, longitude, speed) with gpsbabel"),
    (rb"\s*(<\?xml[^>]*>\s*(<!--.*?-->\s*)?)?<gpx", "GPX", "convert it to CSV with gpsbabel -o unicsv"),
    (rb"\s*(<\?xml[^>]*>\s*(<!--.*?-->\s*)?)?<kml", "KML", "convert it to CSV with gpsbabel -o unicsv"),
    (rb"SQLite format 3\0", "an SQLite database", "export its table as CSV"),
)
REFUSED_ENDINGS = {
    ".drk": ("AiM .drk", "open it in RaceStudio and export it as CSV, or give the .xrk"),
    ".ld": ("MoTeC .ld", "export it from MoTeC i2 as CSV (File, Export)"),
    ".ldx": ("MoTeC .ldx, which holds the laps of an .ld", "export the .ld from MoTeC i2 as CSV (File, Export)"),
    ".vbb": ("VBOX .vbb", "convert it to .vbo with VBOX Test Suite"),
    ".vbs": ("VBOX .vbs", "convert it to .vbo with VBOX Test Suite"),
    ".rcz": ("a RaceChrono session", "export it from RaceChrono as CSV or .vbo"),
    ".rcb": ("a RaceChrono session", "export it from RaceChrono as CSV or .vbo"),
    ".ibt": ("iRacing .ibt", "convert it to CSV (MoTeC i2, or pyirsdk)"),
    ".bmsbin": ("Bosch WinDarab", OWN_CSV),
    ".pds": ("Cosworth Pi", OWN_CSV),
    ".dxd": ("Dewesoft", "export it from DewesoftX as MDF4, MATLAB or CSV"),
    ".d7d": ("Dewesoft", "export it from DewesoftX as MDF4, MATLAB or CSV"),
    ".dat3": ("imc", OWN_CSV),
    ".erg": ("IPG CarMaker .erg", "export it from IPGControl as MATLAB or CSV"),
    ".vs": ("CarSim", "write its outputs as CSV or .mat"),
    ".tlog": ("a MAVLink .tlog", "convert it with mavlogdump.py --format csv"),
    ".bbl": ("a Betaflight blackbox", "convert it with blackbox_decode to CSV"),
    ".tdms": ("TDMS of National Instruments", "export it as CSV, or convert it to HDF5 with npTDMS"),
    ".xlsx": ("an Excel workbook", "save the sheet as CSV"),
    ".xlsm": ("an Excel workbook", "save the sheet as CSV"),
    ".xls": ("an old Excel workbook", "save the sheet as CSV"),
    ".ods": ("a spreadsheet", "save the sheet as CSV"),
    ".fit": ("Garmin .fit", "convert it to CSV with FitCSVTool"),
    ".gpx": ("GPX", "convert it to CSV with gpsbabel -o unicsv"),
    ".kmz": ("KML", "convert it to CSV with gpsbabel -o unicsv"),
    ".pkl": ("a Python pickle, which may run code when it is read", "write it as CSV or .npz"),
    ".pickle": ("a Python pickle, which may run code when it is read", "write it as CSV or .npz"),
    ".npy": (".npy, an array without names", "save named arrays: numpy.savez('run.npz', t=..., v=..., r=...)"),
    ".feather": ("Feather", "write it as Parquet: pandas.read_feather(FILE).to_parquet(NEW)"),
    ".dbc": ("a database of CAN messages and no recording", "give the log of frames, with --dbc FILE"),
}


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
    if ending in REFUSED_ENDINGS:
        return REFUSED_ENDINGS[ending]
    if ending in PACKED:
        return None
    found = ((name, way) for pattern, name, way in REFUSED_MAGIC if re.match(pattern, lead, re.DOTALL))
    if lead.startswith(b"PK\x03\x04"):
        return ("an Excel workbook", "save the sheet as CSV") if b"[Content_Types]" in lead else ("a zip", "unpack it")
    return next(found, None)


def _lead(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.read(LEAD)
