"""Logs and tables of other programs that are not read here: by their first bytes, with the way out.

Sources: rosbag format 2.0 (wiki.ros.org), SQLite's header, ULog encryption of PX4 (docs.px4.io),
blackbox (betaflight.com), Excel, IGC (fai.org), NMEA 0183.
"""

from pathlib import Path
from typing import Final

from aerodb.errors import InputError

_POSITIONS: Final = (
    "it has no attitude, rates or accelerations: use the log of an autopilot or of an instrument"
)
_TRACKS: Final = ("gpx", "kml", "fit", "tcx")
#: First bytes -> what the file is, and the way out.
_MARKS: Final[tuple[tuple[bytes, str, str], ...]] = (
    (
        b"#ROSBAG V1",
        "a bag of ROS 1 in the format before 2.0",
        "convert it: rosbag fix FLIGHT.bag NEW.bag",
    ),
    (
        b"ULogEnc",
        "an encrypted log of PX4",
        "decrypt it with your private key: Tools/decrypt_ulog.py of PX4",
    ),
    (
        b"H Product:Blackbox",
        "a blackbox log of Betaflight or iNav",
        "decode it to CSV: blackbox_decode FLIGHT.bbl",
    ),
    (b"\xd0\xcf\x11\xe0", "an Excel file (.xls)", "save the sheet of the table as CSV"),
    (b"7z\xbc\xaf", "an archive (7z)", "unpack it first"),
    (b"MDF     ", "a measurement file (MDF)", "export its channels as CSV or MAT"),
    *((mark, "positions of a satellite receiver (NMEA)", _POSITIONS) for mark in (b"$GP", b"$GN")),
    (b"TDSm", "a LabVIEW measurement (TDMS)", "export it as CSV"),
)
_NAMES: Final = {
    ".ulge": _MARKS[1],
    ".bbl": _MARKS[2],
    ".bfl": _MARKS[2],
    ".xls": _MARKS[3],
    ".igc": (b"", "positions of a glider's recorder (IGC)", _POSITIONS),
    **{f".{each}": (b"", f"a track ({each.upper()})", _POSITIONS) for each in _TRACKS},
}
#: How DJI calls the records of its apps, which are encrypted.
_DJI: Final = "djiflightrecord"


def refuse_foreign(path: Path, head: bytes) -> None:
    """Raise InputError for a log or table that another program reads, with the way out.

    head : the first bytes of the file, 64 at least if it has them. Files that are none pass.
    """
    found = next(((what, way) for mark, what, way in _MARKS if head.startswith(mark)), None)
    if found is None and path.suffix.lower() in _NAMES:
        found = _NAMES[path.suffix.lower()][1:]
    if path.name.lower().startswith(_DJI) and b"," not in head:
        found = ("a flight record of DJI", "export it as CSV by a viewer of such records")
    if found is not None:
        raise InputError(f"{found[0]}: not read", str(path), found[1])
