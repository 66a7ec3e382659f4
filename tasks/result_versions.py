"""Versions of what each step returns. Bump one when its step returns something else for the same
input; the golden test in tests/tasks/test_golden_keys.py reminds. The number is part of every key
that the step makes."""

from typing import Final

RESULT_VERSION: Final[dict[str, int]] = {
    "ingest": 3,
    "conditioning": 1,
    "consistency": 2,
    "coefficients": 2,
    "compare": 1,
    "import": 1,
    "update": 4,
    "gram": 6,
    "close_loop": 6,
}

#: Names of versions that the product itself moves.
RELEASED: Final = "released"
CANDIDATE: Final = "candidate"
