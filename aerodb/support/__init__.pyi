from .arrays import Array, Integers, Mask
from .dual_numbers import (
    Dual,
    Triple,
    angle,
    arcsine,
    body_to_earth,
    cross,
    dead_zone,
    dot,
    root,
    sine,
)
from .identity import canonical_json, content_sha256, key_of, result_key, version_id
from .parallel import Threads, in_threads
from .strict import Strict, validated, validated_toml
from .toml import parsed_toml

__all__ = [
    "Array",
    "Dual",
    "Integers",
    "Mask",
    "Strict",
    "Threads",
    "Triple",
    "angle",
    "arcsine",
    "body_to_earth",
    "canonical_json",
    "content_sha256",
    "cross",
    "dead_zone",
    "dot",
    "in_threads",
    "key_of",
    "parsed_toml",
    "result_key",
    "root",
    "sine",
    "validated",
    "validated_toml",
    "version_id",
]
