"""Reader of MAVLink telemetry logs (``.tlog``): messages of version 1 and 2 behind their times.

Ground stations write every message that they receive behind eight bytes of time. Of the some three
hundred kinds, those that tell the motion are read; a checksum with a byte of the message's own
definition guards each. Telemetry is thinned out: the log on board is better, where there is one.
"""

import binascii
import hashlib
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.recording import Damage, Recording, Topic

#: First byte of a message, versions 1 and 2, behind 8 bytes of time.
MAGIC: Final = (0xFE, 0xFD)
#: Times of telemetry logs: 2000 to 2100 [us].
_TIMES: Final = (9.4e14, 4.1e15)
#: Length of the head behind the first byte, and whether a signature may follow.
_HEAD: Final = {0xFE: 5, 0xFD: 9}
_SIGNED: Final = 1
_SIGNATURE: Final = 13
_STAMP: Final = 8
#: numpy type of MAVLink's.
_TYPES: Final = {
    **{"float": "<f4", "double": "<f8", "char": "S1", "int8_t": "i1", "uint8_t": "u1"},
    **{"int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4"},
    **{"int64_t": "<i8", "uint64_t": "<u8"},
}


@dataclass(frozen=True)
class Message:
    """Definition of a message: fields in the order of the wire, ``type name`` or ``type[n] name``,
    without extensions. clock : field of the vehicle's time and what one of it is in s. units :
    field -> unit; scales : field -> factor to it."""

    name: str
    fields: tuple[str, ...]
    clock: tuple[str, float] | None = None
    units: Mapping[str, str] | None = None
    scales: Mapping[str, float] | None = None

    @property
    def layout(self) -> np.dtype[Any]:
        """Layout of a message's payload."""
        pairs = (each.split() for each in self.fields)
        return np.dtype([(name, *_kind(kind)) for kind, name in pairs])

    @property
    def extra(self) -> int:
        """Byte of the definition that ends the checksum (MAVLink, "CRC_EXTRA calculation")."""
        crc = crc16(f"{self.name} ".encode())
        for each in self.fields:
            kind, name = each.split()
            base, _, count = kind.partition("[")
            crc = crc16(f"{base} {name} ".encode(), crc)
            if count:
                crc = crc16(bytes([int(count[:-1])]), crc)
        return (crc & 0xFF) ^ (crc >> 8)


def _kind(kind: str) -> tuple[Any, ...]:
    base, _, count = kind.partition("[")
    if not count:
        return (_TYPES[base],)
    return (f"S{count[:-1]}",) if base == "char" else (_TYPES[base], (int(count[:-1]),))


_BOOT: Final = ("time_boot_ms", 1e-3)
_USEC: Final = ("time_usec", 1e-6)
_XYZ: Final = ("x", "y", "z")
_IMU: Final = tuple(f"int16_t {x}{what}" for what in ("acc", "gyro", "mag") for x in _XYZ)
_IMU_UNITS: Final = {**{f"{x}acc": "g" for x in _XYZ}, **{f"{x}gyro": "rad/s" for x in _XYZ}}
_IMU_SCALES: Final = {f"{x}{what}": 1e-3 for what in ("acc", "gyro") for x in _XYZ}
#: Messages by id: MAVLink's common.xml and ardupilotmega.xml (mavlink.io).
MESSAGES: Final[dict[int, Message]] = {
    0: Message(
        "HEARTBEAT",
        (
            *("uint32_t custom_mode", "uint8_t type", "uint8_t autopilot", "uint8_t base_mode"),
            *("uint8_t system_status", "uint8_t mavlink_version"),
        ),
        units={},
    ),
    22: Message(
        "PARAM_VALUE",
        (
            *("float param_value", "uint16_t param_count", "uint16_t param_index"),
            *("char[16] param_id", "uint8_t param_type"),
        ),
    ),
    24: Message(
        "GPS_RAW_INT",
        (
            *("uint64_t time_usec", "int32_t lat", "int32_t lon", "int32_t alt", "uint16_t eph"),
            *("uint16_t epv", "uint16_t vel", "uint16_t cog", "uint8_t fix_type"),
            "uint8_t satellites_visible",
        ),
        None,
        {"lat": "deg", "lon": "deg", "alt": "m", "vel": "m/s", "cog": "deg"},
        {"lat": 1e-7, "lon": 1e-7, "alt": 1e-3, "vel": 1e-2, "cog": 1e-2},
    ),
    26: Message("SCALED_IMU", ("uint32_t time_boot_ms", *_IMU), _BOOT, _IMU_UNITS, _IMU_SCALES),
    27: Message("RAW_IMU", ("uint64_t time_usec", *_IMU), _USEC, _IMU_UNITS, _IMU_SCALES),
    29: Message(
        "SCALED_PRESSURE",
        ("uint32_t time_boot_ms", "float press_abs", "float press_diff", "int16_t temperature"),
        _BOOT,
        {"press_abs": "Pa", "press_diff": "Pa", "temperature": "degC"},
        {"press_abs": 100.0, "press_diff": 100.0, "temperature": 0.01},
    ),
    30: Message(
        "ATTITUDE",
        (
            *("uint32_t time_boot_ms", "float roll", "float pitch", "float yaw"),
            *("float rollspeed", "float pitchspeed", "float yawspeed"),
        ),
        _BOOT,
        {
            **dict.fromkeys(("roll", "pitch", "yaw"), "rad"),
            **dict.fromkeys(("rollspeed", "pitchspeed", "yawspeed"), "rad/s"),
        },
    ),
    32: Message(
        "LOCAL_POSITION_NED",
        ("uint32_t time_boot_ms", *(f"float {x}" for x in (*_XYZ, "vx", "vy", "vz"))),
        _BOOT,
        {**dict.fromkeys(_XYZ, "m"), **dict.fromkeys(("vx", "vy", "vz"), "m/s")},
    ),
    33: Message(
        "GLOBAL_POSITION_INT",
        (
            *("uint32_t time_boot_ms", "int32_t lat", "int32_t lon", "int32_t alt"),
            *("int32_t relative_alt", "int16_t vx", "int16_t vy", "int16_t vz", "uint16_t hdg"),
        ),
        _BOOT,
        {
            **{"lat": "deg", "lon": "deg", "alt": "m", "relative_alt": "m", "hdg": "deg"},
            **dict.fromkeys(("vx", "vy", "vz"), "m/s"),
        },
        {
            **{"lat": 1e-7, "lon": 1e-7, "alt": 1e-3, "relative_alt": 1e-3},
            **dict.fromkeys(("vx", "vy", "vz", "hdg"), 1e-2),
        },
    ),
    36: Message(
        "SERVO_OUTPUT_RAW",
        ("uint32_t time_usec", *(f"uint16_t servo{k}_raw" for k in range(1, 9)), "uint8_t port"),
        None,
        {f"servo{k}_raw": "us" for k in range(1, 9)},
    ),
    65: Message(
        "RC_CHANNELS",
        (
            *("uint32_t time_boot_ms", *(f"uint16_t chan{k}_raw" for k in range(1, 19))),
            *("uint8_t chancount", "uint8_t rssi"),
        ),
        _BOOT,
        {f"chan{k}_raw": "us" for k in range(1, 19)},
    ),
    74: Message(
        "VFR_HUD",
        (
            *("float airspeed", "float groundspeed", "float alt", "float climb"),
            *("int16_t heading", "uint16_t throttle"),
        ),
        None,
        {
            **{"airspeed": "m/s", "groundspeed": "m/s", "alt": "m", "climb": "m/s"},
            **{"heading": "deg", "throttle": "percent"},
        },
    ),
    105: Message(
        "HIGHRES_IMU",
        (
            "uint64_t time_usec",
            *(f"float {x}{what}" for what in ("acc", "gyro", "mag") for x in _XYZ),
            *("float abs_pressure", "float diff_pressure", "float pressure_alt"),
            *("float temperature", "uint16_t fields_updated"),
        ),
        _USEC,
        {
            **{f"{x}acc": "m/s^2" for x in _XYZ},
            **{f"{x}gyro": "rad/s" for x in _XYZ},
            **{"abs_pressure": "Pa", "diff_pressure": "Pa", "pressure_alt": "m"},
            "temperature": "degC",
        },
        {"abs_pressure": 100.0, "diff_pressure": 100.0},
    ),
    116: Message("SCALED_IMU2", ("uint32_t time_boot_ms", *_IMU), _BOOT, _IMU_UNITS, _IMU_SCALES),
    168: Message(
        "WIND",
        ("float direction", "float speed", "float speed_z"),
        None,
        {"direction": "deg", "speed": "m/s", "speed_z": "m/s"},
    ),
    253: Message("STATUSTEXT", ("uint8_t severity", "char[50] text")),
}


#: Reversed bits of each byte: the checksum takes the lowest bit first, `binascii` the highest.
_REVERSED: Final = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def crc16(data: bytes, crc: int = 0xFFFF) -> int:
    """Return the checksum of MAVLink (CRC-16/MCRF4XX), after that of what came before.

    >>> hex(crc16(b"123456789"))
    '0x6f91'
    """
    value = binascii.crc_hqx(data.translate(_REVERSED), int(f"{crc:016b}"[::-1], 2))
    return int(f"{value:016b}"[::-1], 2)


#: MAV_AUTOPILOT of ArduPilot, of PX4, and of what is no autopilot.
_ARDUPILOT: Final = 3
_PX4: Final = 12
_NO_AUTOPILOT: Final = 8
_PLANES: Final = (1, 19, 20, 21, 22, 23, 24, 25)
_EXTRAS: Final = {identity: message.extra for identity, message in MESSAGES.items()}
_LAYOUTS: Final = {identity: message.layout for identity, message in MESSAGES.items()}
#: Values that stand for "not known", by type.
_UNKNOWN: Final = {"<u2": 0xFFFF}
#: Most texts of the autopilot that are kept.
_KEPT: Final = 200

Source = tuple[int, int]


def is_telemetry(head: bytes) -> bool:
    """Return whether a file begins as a telemetry log does: a time [us], then a message."""
    if len(head) <= _STAMP or head[_STAMP] not in MAGIC:
        return False
    (stamp,) = struct.unpack(">Q", head[:_STAMP])
    return bool(_TIMES[0] < stamp < _TIMES[1])


def read_tlog(path: Path) -> Recording:
    """Read a telemetry log of the one vehicle that wrote most of it.

    Returns
    -------
    Recording
        Topics are messages, times in s from the first message: the vehicle's clock where a message
        has one, else the ground station's. Fields are in the units of MAVLink's definition, scaled
        to floats where those are whole numbers. Parameters are metadata. Bytes that belong to no
        message, and messages whose checksum is wrong, are reported as damage.

    Raises
    ------
    InputError
        When the file is no telemetry log, or holds no message that is known here.

    References
    ----------
    mavlink.io: "Packet Serialization", "CRC_EXTRA calculation", common.xml, ardupilotmega.xml.
    """
    data = path.read_bytes()
    found, lost = _messages(data)
    vehicle = _vehicle(found)
    kept = {identity: each for (source, identity), each in found.items() if source == vehicle}
    autopilot, kind = _autopilot(kept)
    topics = dict(_topics(kept, autopilot))
    if topics.keys() <= {"HEARTBEAT"}:
        what = "the telemetry log holds no message of a vehicle's motion"
        remedy = "use the log on board (.bin, .ulg); telemetry of a link that was down is empty"
        raise InputError(what, str(path), remedy)
    first = min(float(topic.time[0]) for topic in topics.values())
    topics = {name: replace(topic, time=topic.time - first) for name, topic in topics.items()}
    damage = []
    if lost:
        what = f"{lost} bytes belong to no message, or to one whose checksum is wrong"
        damage.append(Damage("framing", what, bytes_lost=lost))
    return Recording(
        str(path),
        "mavlink",
        hashlib.sha256(data).hexdigest(),
        len(data),
        topics,
        _metadata(kept, autopilot, kind),
        tuple(damage),
        datetime.fromtimestamp(first, UTC),
        "mavlink" if "ATTITUDE" in topics else "",
    )


@dataclass
class _Found:
    """Messages of one kind and source: times of the ground station [us], payloads padded to the
    layout."""

    stamps: list[int]
    payloads: bytearray


def _messages(data: bytes) -> tuple[dict[tuple[Source, int], _Found], int]:
    """Messages by source and id, and the bytes that belong to none."""
    found: dict[tuple[Source, int], _Found] = {}
    position, lost, size = 0, 0, len(data)
    while position < size:
        end = _end_of(data, position)
        if end is None:
            # A time [us] of this century begins with a byte of zero.
            step = data.find(b"\x00", position + 1)
            step = size if step < 0 else step
            lost += step - position
            position = step
            continue
        begin = position + _STAMP
        if data[begin] == MAGIC[0]:
            length, source, identity = (
                data[begin + 1],
                (data[begin + 3], data[begin + 4]),
                data[begin + 5],
            )
            payload = begin + 6
        else:
            length, source = data[begin + 1], (data[begin + 5], data[begin + 6])
            identity = int.from_bytes(data[begin + 7 : begin + 10], "little")
            payload = begin + 10
        if identity in MESSAGES:
            held = found.setdefault((source, identity), _Found([], bytearray()))
            layout = _LAYOUTS[identity].itemsize
            held.stamps.append(int.from_bytes(data[position:begin], "big"))
            held.payloads += data[payload : payload + length][:layout].ljust(layout, b"\0")
        position = end
    return found, lost


def _end_of(data: bytes, position: int) -> int | None:
    """Where the message at `position` ends; None if there is none: a message that is known by its
    checksum, another by the one that follows it."""
    begin = position + _STAMP
    if not is_telemetry(data[position : begin + 1]) or begin + 12 > len(data):
        return None
    head = _HEAD[data[begin]]
    payload, length = begin + 1 + head, data[begin + 1]
    end = payload + length + 2
    if head == _HEAD[MAGIC[0]]:
        identity = data[begin + 5]
    else:
        identity = int.from_bytes(data[begin + 7 : begin + 10], "little")
    if end > len(data):
        return None
    signed = head != _HEAD[MAGIC[0]] and data[begin + 2] & _SIGNED
    after = end + (_SIGNATURE if signed else 0)
    if identity in _EXTRAS:
        crc = crc16(data[begin + 1 : end - 2] + bytes([_EXTRAS[identity]]))
        return after if crc == int.from_bytes(data[end - 2 : end], "little") else None
    follows = data[after : after + _STAMP + 1]
    return after if after >= len(data) - _STAMP or is_telemetry(follows) else None


def _vehicle(found: Mapping[tuple[Source, int], _Found]) -> Source | None:
    """The source of most messages among autopilots; of attitudes, where none says what it is."""
    counts: dict[Source, int] = {}
    for (source, identity), each in found.items():
        if identity == 30:
            counts[source] = len(each.stamps)
    return max(counts, key=lambda source: counts[source], default=None)


def _autopilot(kept: Mapping[int, _Found]) -> tuple[int, int]:
    """MAV_AUTOPILOT and MAV_TYPE of the last heartbeat that is an autopilot's; 0 where none is."""
    if 0 not in kept:
        return 0, 0
    rows = np.frombuffer(bytes(kept[0].payloads), _LAYOUTS[0])
    rows = rows[rows["autopilot"] != _NO_AUTOPILOT]
    return (int(rows["autopilot"][-1]), int(rows["type"][-1])) if len(rows) else (0, 0)


def _topics(kept: Mapping[int, _Found], autopilot: int) -> Iterator[tuple[str, Topic]]:
    """Topics on one clock [s]: that of the vehicle, moved to the ground station's."""
    shifts = []
    rows = {
        identity: np.frombuffer(bytes(e.payloads), _LAYOUTS[identity])
        for identity, e in kept.items()
    }
    ground = {
        identity: np.array(each.stamps, dtype=np.float64) * 1e-6 for identity, each in kept.items()
    }
    boot: dict[int, NDArray[np.float64]] = {}
    for identity, each in rows.items():
        clock = MESSAGES[identity].clock
        if clock is not None:
            stamps = each[clock[0]].astype(np.float64) * clock[1]
            # A clock that begins anew, or is a time of day, is of no use beside the others.
            if np.all(np.diff(stamps) >= 0.0) and stamps[-1] < _TIMES[0] * 1e-6:
                boot[identity] = stamps
                shifts.append(float(np.min(ground[identity] - stamps)))
    shift = min(shifts, default=0.0)
    for identity, each in rows.items():
        message = MESSAGES[identity]
        if message.units is None or (message.name == "RAW_IMU" and autopilot != _ARDUPILOT):
            continue
        clock_name = message.clock[0] if message.clock else "time_usec"
        fields = {}
        for name in each.dtype.names or ():
            if name in ("time_usec", clock_name) or each.dtype[name].kind not in "iuf":
                continue
            values = each[name] * (message.scales or {}).get(name, 1.0)
            unknown = _UNKNOWN.get(each.dtype[name].str)
            if unknown is not None and name in message.units:
                values = np.where(each[name] == unknown, np.nan, values)
            fields[name] = np.asarray(values, dtype=np.float64)
        time = boot[identity] + shift if identity in boot else ground[identity]
        yield message.name, Topic(message.name, time, fields, dict(message.units))


def _metadata(
    kept: Mapping[int, _Found], autopilot: int, kind: int
) -> dict[str, str | int | float]:
    """Parameters as received last, texts of the autopilot, and what it is."""
    found: dict[str, str | int | float] = {}
    if 22 in kept:
        for row in np.frombuffer(bytes(kept[22].payloads), _LAYOUTS[22]):
            found[f"param:{_text(row['param_id'])}"] = float(row["param_value"])
    if 253 in kept:
        texts = np.frombuffer(bytes(kept[253].payloads), _LAYOUTS[253])["text"]
        found["messages"] = "\n".join(_text(text) for text in texts[:_KEPT])
    if autopilot == _ARDUPILOT:
        found["sys_name"] = "ArduPlane" if kind in _PLANES else "ArduCopter"
    elif autopilot == _PX4:
        found["sys_name"] = "PX4"
    return found


def _text(value: bytes) -> str:
    return bytes(value).split(b"\0", 1)[0].decode("utf-8", errors="replace").strip()
