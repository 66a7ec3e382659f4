"""Documents as JSON that any reader takes: what has no number is null, what is no JSON becomes
text."""

import json
import math
from typing import Any


def finite(value: Any) -> Any:
    """`value` with None for numbers that JSON cannot write: the rate of a topic with one sample,
    say.

    >>> finite({"rate": float("inf"), "all": (1.0, float("nan"))})
    {'rate': None, 'all': [1.0, None]}
    """
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    return [finite(entry) for entry in value] if isinstance(value, (list, tuple)) else value


def as_json(document: Any, indent: int | None = None) -> str:
    """A document as ASCII JSON."""
    return json.dumps(finite(document), indent=indent, default=str, allow_nan=False)
