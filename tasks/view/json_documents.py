"""Documents as strict JSON: a non-finite number becomes null, other objects become text."""

import json
import math
from typing import Any


def finite(value: Any) -> Any:
    """Return `value` with None for every number that JSON cannot represent.

    One example is the rate of a topic with a single sample.

    >>> finite({"rate": float("inf"), "all": (1.0, float("nan"))})
    {'rate': None, 'all': [1.0, None]}
    """
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    return [finite(entry) for entry in value] if isinstance(value, (list, tuple)) else value


def as_json(document: Any, indent: int | None = None) -> str:
    """Return a document as ASCII JSON (RFC 8259); numbers that are not `finite` become null, and
    raise no error."""
    return json.dumps(finite(document), indent=indent, default=str, allow_nan=False)
