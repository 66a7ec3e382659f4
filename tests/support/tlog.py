"""Telemetry logs of our own: MAVLink messages of both versions, with a checksum computed bit by
bit."""

import struct
from dataclasses import dataclass, field

#: Message -> id, struct format in the order of the wire, and the byte that ends its checksum, as
#: MAVLink's C headers publish it.
MESSAGES = {
    "HEARTBEAT": (0, "<IBBBBB", 50),
    "PARAM_VALUE": (22, "<fHH16sB", 220),
    "RAW_IMU": (27, "<Q9h", 144),
    "SCALED_PRESSURE": (29, "<Iffh", 115),
    "ATTITUDE": (30, "<I6f", 39),
    "GLOBAL_POSITION_INT": (33, "<IiiiihhhH", 104),
    "VFR_HUD": (74, "<ffffhH", 20),
    "STATUSTEXT": (253, "<B50s", 83),
    "MISSION_CURRENT": (42, "<H", 28),
}
#: 2024-03-12 14:00 UTC [us].
START = 1_710_252_000_000_000


def checksum(data: bytes) -> int:
    """CRC-16/MCRF4XX, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0x8408 if crc & 1 else 0)
    return crc


@dataclass
class Telemetry:
    """A telemetry log in the making; version 1 or 2 of MAVLink, `signed` in version 2."""

    version: int = 2
    signed: bool = False
    data: bytearray = field(default_factory=bytearray)
    ends: list[tuple[int, str]] = field(default_factory=list)

    def add(self, seconds: float, name: str, *values: object, system: int = 1) -> None:
        """Write a message that arrives after so many seconds."""
        identity, layout, extra = MESSAGES[name]
        payload = struct.pack(layout, *values)
        sequence = len(self.ends) % 256
        if self.version == 1:
            body = bytes([len(payload), sequence, system, 1, identity]) + payload
            magic = b"\xfe"
        else:
            payload = payload.rstrip(b"\0") or b"\0"
            flags = 1 if self.signed else 0
            head = [len(payload), flags, 0, sequence, system, 1]
            body = bytes(head) + identity.to_bytes(3, "little") + payload
            magic = b"\xfd"
        crc = struct.pack("<H", checksum(body + bytes([extra])))
        tail = bytes(13) if self.signed and self.version == 2 else b""
        self.data += struct.pack(">Q", START + round(seconds * 1e6)) + magic + body + crc + tail
        self.ends.append((len(self.data), name))
