"""Header of LabVIEW measurement files (`.lvm`), above an ordinary table."""

import re
from typing import Final

_BEGIN: Final = b"LabVIEW Measurement"
_END: Final = b"***End_of_Header***"


def without_labview_header(data: bytes) -> bytes:
    """Return the table of a LabVIEW measurement file: names, units and samples; other data as they
    are.

    Where the file writes no times (``X_Columns No``), they follow from ``X0`` and ``Delta_X`` [s].
    Only the first of several segments has its header here.
    """
    if not data.startswith(_BEGIN):
        return data
    lines = data.replace(b"\r\n", b"\n").split(b"\n")
    ends = [number for number, line in enumerate(lines[:100]) if line.startswith(_END)]
    if not ends:
        return data
    head, table = lines[: ends[-1]], lines[ends[-1] + 1 :]
    sep = b"," if _value(head, b"Separator", b"\t").startswith(b"Comma") else b"\t"
    units = next((line for line in head if line.startswith(b"Y_Unit_Label")), b"")
    if units and table:
        own = [b"s", *units.split(sep)[1:]]
        lacking = max(0, table[0].count(sep) + 1 - len(own))
        table.insert(1, sep.join([*own, *[b""] * lacking]))
    step, start = (_number(_value(head, name, sep)) for name in (b"Delta_X", b"X0"))
    if step is None:
        return b"\n".join(table)
    first = next((k for k, line in enumerate(table) if k and line.startswith(sep)), len(table))
    comma = _value(head, b"Decimal_Separator", sep).startswith(b",")
    for row, line in enumerate(table[first:]):
        if line.startswith(sep):
            time = f"{(start or 0.0) + row * step:.9g}"
            table[first + row] = (time.replace(".", ",") if comma else time).encode() + line
    return b"\n".join(table)


def _value(head: list[bytes], name: bytes, sep: bytes) -> bytes:
    """The first value behind a name of the header, b'' without one."""
    line = next((each for each in head if re.match(re.escape(name) + rb"[\t,]", each)), b"")
    return line[len(name) + 1 :].split(sep)[0].strip() if line else b""


def _number(text: bytes) -> float | None:
    try:
        return float(text.replace(b",", b"."))
    except ValueError:
        return None
