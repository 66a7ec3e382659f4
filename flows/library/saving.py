"""Results in files: what they say, their arrays, and a candidate database.

No code is stored, so that a file from anyone can be read."""

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError, StoreError
from aerodb.exchange import from_document, to_document
from aerodb.flows.library.views import Data, Result, Summary, Values
from aerodb.tables import AeroDatabase
from aerodb.tasks.view import as_json

#: Version of the form of these files.
_FORM: Final = 1
_HEAD: Final = "result.json"
_ARRAYS: Final = "arrays.npz"
_CANDIDATE: Final = "candidate.json"
#: Most bytes of a part of a file once it is unpacked.
_LARGEST: Final = 4_000_000_000


@dataclass(frozen=True, eq=False, repr=False)
class SavedResult(Result):
    """A result that was saved: what it said, and its arrays.

    kind : the class that it had. candidate : its database, None where it had none; in SI units.
    """

    kind: str
    candidate: AeroDatabase | None
    _summary: Summary
    _data: Data
    _headlines: list[str]
    _report: str

    def summary(self) -> Summary:
        """Return what the result said of itself, with units as it said them."""
        return self._summary

    def data(self) -> Data:
        """Return its quantities, arrays (n,) or over two axes, with their units."""
        return self._data

    def headlines(self) -> list[str]:
        """Return what it gave to decide on; see `Result.headlines`."""
        return self._headlines

    def report(self) -> str:
        """Return its report as text; see `Result.report`."""
        return self._report


def save_result(result: Result, path: Path) -> Path:
    """Write a result, arrays (n,) with their units, to a file; StoreError where it cannot be
    written."""
    data = result.data()
    parts = {"c": data.coordinates, "q": data.quantities}
    arrays = {
        f"{kind}{k}": _plain(each.values)
        for kind, values in parts.items()
        for k, each in enumerate(values.values())
    }
    head = {
        "form": _FORM,
        "kind": getattr(result, "kind", type(result).__name__),
        "summary": asdict(result.summary()),
        "headlines": result.headlines(),
        "report": result.report(),
        "index": data.index,
        "attributes": dict(data.attributes),
        **{
            kind: [
                {"name": name, "dims": list(v.dims), "unit": v.unit, "description": v.description}
                for name, v in values.items()
            ]
            for kind, values in parts.items()
        },
    }
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)  # type: ignore[arg-type]
    candidate = getattr(result, "candidate", None)
    try:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr(_HEAD, as_json(head))
            file.writestr(_ARRAYS, packed.getvalue())
            if isinstance(candidate, AeroDatabase):
                file.writestr(_CANDIDATE, json.dumps(to_document(candidate)))
    except OSError as error:
        what = f"the result cannot be saved: {error.strerror or error}"
        raise StoreError(what, str(path), "choose another path") from error
    return path


def load_result(path: str | Path) -> SavedResult:
    """Return a result that `Result.save` wrote: report, plot, arrays (n,) and candidate, in the
    units that it had.

    Raises InputError for a file that cannot be read or is none of these.
    """
    try:
        with zipfile.ZipFile(path) as file:
            if any(part.file_size > _LARGEST for part in file.infolist()):
                raise InputError("it unpacks to more than 4 GB", str(path), "save it again")
            head = json.loads(file.read(_HEAD))
            packed = np.load(io.BytesIO(file.read(_ARRAYS)), allow_pickle=False)
            arrays = {name: packed[name] for name in packed.files}
            named = _CANDIDATE in file.namelist()
            candidate = json.loads(file.read(_CANDIDATE)) if named else None
        if head["form"] != _FORM:
            raise InputError(f"its form {head['form']} is unknown", str(path), "update aerodb")
        parts = {kind: _values(head[kind], arrays, kind) for kind in "cq"}
        data = Data(head["index"], parts["c"], parts["q"], head["attributes"])
        return SavedResult(
            str(head["kind"]),
            None if candidate is None else from_document(candidate, str(path)),
            Summary(**head["summary"]),
            data,
            list(head["headlines"]),
            str(head["report"]),
        )
    except OSError as error:
        what = f"the file cannot be read: {error.strerror or error}"
        raise InputError(what, str(path), "check its name and permissions") from error
    except (KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("not a saved result", str(path), "write it with save()") from error


def _plain(values: NDArray[Any]) -> NDArray[Any]:
    """Texts as an array that needs no pickle."""
    return values.astype(str) if values.dtype == object else values


def _values(
    named: list[Mapping[str, Any]], arrays: Mapping[str, NDArray[Any]], kind: str
) -> dict[str, Values]:
    return {
        each["name"]: Values(
            tuple(each["dims"]),
            _with_objects(arrays[f"{kind}{k}"]),
            each["unit"],
            each["description"],
        )
        for k, each in enumerate(named)
    }


def _with_objects(values: NDArray[Any]) -> NDArray[Any]:
    return values.astype(object) if values.dtype.kind == "U" else values
