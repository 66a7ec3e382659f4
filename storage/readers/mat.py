"""MATLAB's MAT files, version 5 to 7.3, as named arrays and texts.

Variables of version 5-7 before a cut are read, and damaged ones are left out and reported.
Version 7.3 is HDF5. Cells of texts are labels of columns. Other cells, sparse matrices, objects and
arrays of structs contain no series of samples and are listed in `skipped`; MATLAB's objects are
named with the way to save what they hold.
"""

import io
import math
import struct
from dataclasses import dataclass, field
from typing import Any, Final, NoReturn

import h5py
import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.recording import Damage
from aerodb.support import MOST_EXPANSION, Malformed, MatClass, MatElements, MatHeader

#: Bytes that a file may expand to.
MOST_BYTES: Final = 4 << 30
#: Most variables of a file.
_MOST_VARIABLES: Final = 20_000
#: Most structures or groups inside each other.
_DEEPEST: Final = 8


@dataclass
class Variables:
    """Arrays and texts by dotted name, as stored in the file; cells of texts; names of variables
    that are not arrays; what MATLAB's objects are; damage."""

    values: dict[str, NDArray[Any] | str] = field(default_factory=dict)
    labels: dict[str, list[str]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    damage: list[Damage] = field(default_factory=list)

    def add(self, name: str, value: NDArray[Any] | str) -> None:
        """Add one variable, an array (n,) or a text; raises Malformed if there are more than any
        log has."""
        if len(self.values) >= _MOST_VARIABLES:
            raise Malformed("too many variables")
        self.values[name] = value


#: Class of MATLAB's objects -> how to save what they hold, as MATLAB writes it.
_WAYS: Final = {
    "timetable": "S = table2struct(timetable2table({0}), 'ToScalar', true)",
    "table": "S = table2struct({0}, 'ToScalar', true)",
    "datetime": "S.time = posixtime({0})",
    "duration": "S.time = seconds({0})",
    "timeseries": "S.time = {0}.Time; S.data = {0}.Data",
    "string": "S.{0} = char({0})",
    "categorical": "S.{0} = double({0})",
}


def _object(name: str, kind: str) -> str:
    """What a MATLAB object is, and how to save what it holds."""
    plain = name.rsplit(".", 1)[-1]
    way = _WAYS.get(kind, "S = struct({0})").format(plain)
    return (
        f"{name} is a MATLAB {kind or 'object'}, not read: save it as {way};"
        " save('flight.mat', '-struct', 'S')"
    )


def read_mat5(data: bytes) -> Variables:
    """Return the variables of a MAT file of version 5 to 7; a truncated or damaged variable is left
    out and reported. Arrays keep their shape; losses are in [bytes] (`Damage`)."""
    file = MatElements.of_file(data)
    variables = Variables()
    subsystem = struct.unpack(file.order + "Q", data[116:124])[0]
    while file.at < len(data):
        start = file.at
        try:
            array = file.array(MOST_BYTES)
            if start != subsystem:
                _add(array, "", variables, 0)
        except (ValueError, OverflowError) as error:
            if file.at == start:
                what = f"the file ends inside a variable: {error}"
                variables.damage.append(Damage("lost_tail", what, bytes_lost=len(data) - start))
                break
            what = f"variable at byte {start} cannot be read: {error}"
            variables.damage.append(Damage("framing", what, bytes_lost=file.at - start))
    return variables


def _add(array: MatElements, prefix: str, variables: Variables, depth: int) -> None:
    """Add a variable under its own name, or under `prefix` if it is a member of a struct."""
    if not array.data:
        return
    header = array.header()
    name = prefix or header.name or "an object"
    if header.kind == MatClass.STRUCT and header.shape == (1, 1) and depth < _DEEPEST:
        for member in array.fields():
            _add(array.array(), f"{name}.{member}", variables, depth + 1)
    elif header.kind == MatClass.CHAR and len(header.shape) == 2 and header.shape[0] <= 1:
        variables.add(name, array.text(errors="replace"))
    elif header.is_number and not header.is_complex:
        variables.add(name, array.shaped(header))
    elif header.kind == MatClass.CELL and (labels := _texts(array, header)):
        variables.labels[name] = labels
    elif header.kind == MatClass.OPAQUE:
        own, _, kind = (bytes(array.element()[1]).decode("latin-1") for _ in range(3))
        variables.skipped.append(prefix or own or name)
        variables.remarks.append(_object(prefix or own or name, kind))
    else:
        variables.skipped.append(name)


def _texts(array: MatElements, header: MatHeader) -> list[str]:
    """The texts of a cell; empty where it holds anything else."""
    texts: list[str] = []
    for _ in range(min(math.prod(header.shape), _MOST_VARIABLES)):
        inner = array.array()
        if not inner.data or inner.header().kind != MatClass.CHAR:
            return []
        texts.append(inner.text(errors="replace").strip())
    return texts


def read_hdf5(data: bytes, where: str) -> Variables:
    """Variables of a MAT file of version 7.3, or of any HDF5 file: groups as structs, arrays
    transposed (MATLAB stores columns first).

    Raises InputError for bytes that are not HDF5, and for data that HDF5 would fetch from another
    file or by a path: a log holds its samples itself. Arrays (n,) or matrices, in the units of the
    file.
    """
    variables = Variables()
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            _group(file, "", variables, 0, where)
    except InputError:
        raise
    except Exception as error:  # h5py passes on errors of many types from the HDF5 library
        raise InputError(
            f"not readable as HDF5: {str(error)[:200]}",
            where,
            "write the log again, or cut it to whole samples",
        ) from error
    return variables


def _refuse(what: str, name: str, where: str) -> NoReturn:
    remedy = "save the log again, with its samples in the file itself (h5repack, or MATLAB's save)"
    raise InputError(f"variable {name} {what}", where, remedy)


def _own(item: Any, name: str, where: str) -> Any:
    """Return a dataset or group whose bytes are in this file; InputError for others."""
    if isinstance(item, h5py.Dataset):
        if item.id.get_create_plist().get_external_count():
            _refuse(
                f"has its samples in another file, {str(item.external[0][0])[:80]}", name, where
            )
        if item.is_virtual:
            _refuse("is put together from datasets of other files", name, where)
    return item


def _group(group: Any, prefix: str, variables: Variables, depth: int, where: str) -> None:
    for key in group:
        name = f"{prefix}{key}"
        if key.startswith("#"):
            continue
        link = group.get(key, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            _refuse(f"is a link into another file, {str(link.filename)[:80]}", name, where)
        if isinstance(link, h5py.SoftLink):
            _refuse(f"is a link to {str(link.path)[:80]}", name, where)
        try:
            item = _own(group[key], name, where)
            if isinstance(item, h5py.Group):
                if depth < _DEEPEST:
                    _group(item, f"{name}.", variables, depth + 1, where)
                else:
                    variables.skipped.append(name)
            elif "MATLAB_object_decode" in item.attrs:
                kind = bytes(item.attrs.get("MATLAB_class", b"")).decode("latin-1")
                variables.skipped.append(name)
                variables.remarks.append(_object(name, kind))
            elif _is_array(item):
                _dataset(item, name, variables)
            elif labels := _referred_texts(item, name, where):
                variables.labels[name] = labels
            else:
                variables.skipped.append(name)
        except InputError:
            raise
        except Exception as error:  # as above; one damaged variable leaves the others
            variables.damage.append(
                Damage("framing", f"variable {name} cannot be read: {str(error)[:120]}")
            )


def _referred_texts(item: Any, name: str, where: str) -> list[str]:
    """The texts of a cell of version 7.3, whose datasets it refers to; empty for anything else."""
    if not isinstance(item, h5py.Dataset) or item.attrs.get("MATLAB_class") != b"cell":
        return []
    if item.size > _MOST_VARIABLES:
        return []
    texts = []
    for reference in np.asarray(item[()]).T.ravel(order="F"):
        each = _own(item.file[reference], name, where)
        if each.attrs.get("MATLAB_class") != b"char" or each.size > _MOST_VARIABLES:
            return []
        codes = np.asarray(each[()]).T.ravel(order="F")
        texts.append("".join(chr(int(code)) for code in codes).strip())
    return texts


def _is_array(item: Any) -> bool:
    return (
        isinstance(item, h5py.Dataset)
        and item.dtype.kind in "fiub"
        and item.ndim >= 1
        and "MATLAB_empty" not in item.attrs
    )


def _dataset(item: Any, name: str, variables: Variables) -> None:
    declared, stored = item.size * item.dtype.itemsize, item.id.get_storage_size()
    if declared > min(MOST_BYTES, MOST_EXPANSION * (stored + 64)):
        raise Malformed(f"{declared} bytes declared, {stored} present")
    values = np.asarray(item[()]).T
    if item.attrs.get("MATLAB_class") == b"char":
        variables.add(name, "".join(chr(int(code)) for code in values.ravel(order="F")))
    else:
        variables.add(name, values)
