"""Identities of stored content: the same content has the same key on every machine.

A stored result's key is the sha256 of canonical JSON (RFC 8785) of its input hashes, resolved
settings and the result version of its step. Floats are written by RFC 8785's shortest round-trip
rule, so that equal values give equal keys.
"""

import hashlib
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import rfc8785

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def canonical_json(value: Any) -> bytes:
    """Return `value` as canonical JSON (RFC 8785): sorted keys, shortest floats, UTF-8.

    >>> canonical_json({"b": 1.0, "a": [2, None]})
    b'{"a":[2,null],"b":1}'
    """
    return rfc8785.dumps(value)


def key_of(value: Any) -> str:
    """Return the sha256 (64 hexadecimal digits) of the canonical JSON (RFC 8785) of `value`."""
    return hashlib.sha256(canonical_json(value)).hexdigest()


def result_key(
    inputs: Mapping[str, str], settings: Mapping[str, Any], step: str, result_version: int
) -> str:
    """Return the key (sha256) of a stored result; see docs/reference/conventions.md, section "Names
    and identities".

    inputs : name -> hash of each input. settings : resolved settings. step, result_version : which
    step computed it, and the version of that step's result.
    """
    return key_of(
        {
            "inputs": dict(inputs),
            "settings": dict(settings),
            "step": step,
            "result_version": result_version,
        }
    )


def version_id(
    vehicle: str, parent: str | None, inputs: Iterable[str], settings: Mapping[str, Any]
) -> str:
    """Return the id of a database version; equal inputs and settings give equal ids everywhere.

    See docs/reference/conventions.md, section "Names and identities".
    """
    return key_of(
        {"vehicle": vehicle, "parent": parent, "inputs": sorted(inputs), "settings": dict(settings)}
    )


def content_sha256(arrays: "Iterable[NDArray[np.float64]]") -> str:
    """Return the sha256 of arrays, to check the integrity of tables.

    Hashed are the values as little-endian float64, each array preceded by its shape.
    """
    import numpy as np  # keys of documents need no numerical code

    digest = hashlib.sha256()
    for array in arrays:
        digest.update(repr(tuple(array.shape)).encode())
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()
