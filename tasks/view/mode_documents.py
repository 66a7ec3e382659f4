"""Modes as a part of documents."""

import math
from collections.abc import Sequence
from typing import Any

from aerodb.simulation import Mode


def modes_part(found: Sequence[Mode]) -> list[dict[str, Any]]:
    """Return what documents say of modes, a list (m,): eigenvalues in 1/s, figures and their
    standard errors in SI units; null for an infinite figure."""
    return [
        {
            "name": mode.name,
            "real": mode.eigenvalue.real,
            "imaginary": mode.eigenvalue.imag,
            "figures": {
                name: value if math.isfinite(value) else None
                for name, value in mode.figures.items()
            },
            "standard_errors": dict(mode.standard_errors) or None,
            "participation": dict(mode.participation),
            "note": mode.note,
        }
        for mode in found
    ]
