"""DataFlash logs written by the letter of AP_Logger/LogStructure.h, independently of the reader:
Python's `struct`, one record at a time."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from aerodb.recording import Topic

#: Format character -> code of `struct`, and how often a stored value is larger than the value.
CODES = {
    "b": "b", "B": "B", "M": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d",
    "q": "q", "Q": "Q", "n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I",
    "L": "i",
}  # fmt: skip
STORED = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 10_000_000}
UNITS = {
    "s": "s", "d": "deg", "k": "deg/s", "E": "rad/s", "o": "m/s/s", "n": "m/s", "m": "m", "P": "Pa",
    "O": "degC", "D": "deglatitude", "U": "deglongitude", "h": "degheading", "Y": "us", "#": "instance",
    "-": "", "?": "UNKNOWN",
}  # fmt: skip
MULTIPLIERS = {"-": 0.0, "?": 1.0, "0": 1.0, "A": 1e-1, "B": 1e-2, "C": 1e-3, "F": 1e-6, "G": 1e-7}
#: Name -> id, format, labels, units, multipliers: ArduPlane 4.3.
MESSAGES = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns", "-b---", "-----"),
    "UNIT": (129, "QbZ", "TimeUS,Id,Label", "s--", "F--"),
    "MULT": (130, "Qbd", "TimeUS,Id,Mult", "s--", "F--"),
    "FMTU": (131, "QBNN", "TimeUS,FmtType,UnitIds,MultIds", "s---", "F---"),
    "PARM": (64, "QNff", "TimeUS,Name,Value,Default", "s---", "F---"),
    "MSG": (65, "QZ", "TimeUS,Message", "s-", "F-"),
    "IMU": (66, "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz", "s#EEEooo--O--zz", "F-000000-----00"),
    "ATT": (67, "QccccCCCCB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF", "sddddhhdh-", "FBBBBBBBB-"),
    "GPS": (68, "QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U", "s#-s-S-DUmnhnh-", "F--C-0BGGB000--"),
    "BARO": (69, "QBffcfIffB", "TimeUS,I,Alt,Press,Temp,CRt,SMS,Offset,GndTemp,Health", "s#mPOnsmO-", "F-00B0C?0-"),
    "ARSP": (70, "QBffcffBBffB", "TimeUS,I,Airspeed,DiffPress,Temp,RawPress,Offset,U,H,Hp,TR,Pri", "s#nPOPP-----", "F-00B00-----"),
    "XKF1": (71, "QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH", "s#ddhnnnnmmmkkkm", "F-BBB0000000BBBB"),
    "XKF2": (72, "QBccccchhhhhhfff", "TimeUS,C,AX,AY,AZ,VWN,VWE,MN,ME,MD,MX,MY,MZ,IDX,IDY,IS", "s#---nnGGGGGGoor", "F----BBCCCCCC000"),
    "AETR": (73, "Qhhhhh", "TimeUS,Ail,Elev,Thr,Rudd,Flap", "s-----", "F-----"),
    "RCOU": (74, "QHHHH", "TimeUS,C1,C2,C3,C4", "sYYYY", "F----"),
    "RFND": (75, "QBCBB", "TimeUS,Instance,Dist,Stat,Orient", "s#m--", "F-B--"),
    "MAG": (76, "QBhhh", "TimeUS,I,MagX,MagY,MagZ", "s#GGG", "F-CCC"),
}  # fmt: skip


@dataclass
class DataFlashWriter:
    """A log in the making; `ends` (position behind it, name) of every record."""

    data: bytearray = field(default_factory=bytearray)
    ends: list[tuple[int, str]] = field(default_factory=list)

    @classmethod
    def begun(cls, names: Sequence[str] = tuple(MESSAGES), units: bool = True) -> "DataFlashWriter":
        """A log that describes these messages, with their units as newer firmware does."""
        log = cls()
        for name in names:
            log.describe(name, *MESSAGES[name][:3])
        for k, (character, unit) in enumerate(UNITS.items() if units else ()):
            log.add("UNIT", k, ord(character), unit)
        for k, (character, factor) in enumerate(MULTIPLIERS.items() if units else ()):
            log.add("MULT", k, ord(character), factor)
        for k, name in enumerate(names if units else ()):
            log.add("FMTU", k, MESSAGES[name][0], *MESSAGES[name][3:])
        return log

    def describe(self, name: str, identity: int, characters: str, labels: str) -> None:
        """Write an FMT record."""
        size = 3 + struct.calcsize("<" + "".join(CODES[c] for c in characters))
        self._write(
            "FMT",
            bytes((0xA3, 0x95, 128))
            + struct.pack(
                "<BB4s16s64s", identity, size, name.encode(), characters.encode(), labels.encode()
            ),
        )

    def add(self, name: str, *values: object) -> None:
        """Write a record; times in us, everything else in the unit that its format implies."""
        identity, characters = MESSAGES[name][:2]
        stored = [
            value.encode()
            if isinstance(value, str)
            else round(value * STORED.get(c, 1))  # type: ignore[operator]
            if c not in "fd"
            else value
            for c, value in zip(characters, values, strict=True)
        ]
        codes = "<" + "".join(CODES[c] for c in characters)
        self._write(name, bytes((0xA3, 0x95, identity)) + struct.pack(codes, *stored))

    def _write(self, name: str, record: bytes) -> None:
        self.data += record
        self.ends.append((len(self.data), name))


def write_dataflash(
    path: Path, topics: Sequence[Topic], firmware: str = "ArduPlane V4.3.0"
) -> None:
    """Write topics, whose names and fields are those of `MESSAGES`, as one log in order of time;
    fields that a topic lacks are 0."""
    log = DataFlashWriter.begun()
    log.add("MSG", 1000, firmware)
    for function, servo in ((4, 1), (4, 2), (19, 3), (21, 4)):
        log.add("PARM", 1000, f"SERVO{servo}_FUNCTION", float(function), 0.0)
    rows = sorted(
        ((round(time * 1e6), topic, k) for topic in topics for k, time in enumerate(topic.time)),
        key=lambda row: row[0],
    )
    for us, topic, k in rows:
        labels = MESSAGES[topic.name][2].split(",")[1:]
        values = (topic.fields[name][k] if name in topic.fields else 0 for name in labels)
        log.add(topic.name, us, *(float(each) for each in values))
    path.write_bytes(bytes(log.data))
