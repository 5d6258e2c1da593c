"""Formats that are not read, and the way from each to one that is."""

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
    Refused("Feather", PANDAS, (".feather",)),
    Refused("Arrow or Feather", PANDAS, (), rb"ARROW1|FEA1"),
    Refused("an SQLite database", "export its table as CSV", (), rb"SQLite format 3\0"),
    Refused("a database of CAN messages and no recording", "give the log of frames, with --dbc FILE", (".dbc",)),
)  # fmt: skip
