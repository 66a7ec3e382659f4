"""Version of what each step returns; it is part of every key that the step makes.

Bump a step's number when the step returns something else for the same input. The golden test in
tests/tasks/test_golden_keys.py fails if this is forgotten.
"""

from typing import Final

RESULT_VERSION: Final[dict[str, int]] = {
    "ingest": 11,
    "conditioning": 38,
    "consistency": 29,
    "coefficients": 5,
    "compare": 27,
    "import": 3,
    "fly": 8,
    "estimate": 29,
    "update": 40,
    "gram": 22,
    "close_loop": 76,
}

#: Of what `import` makes of JSBSim files, in their keys alone.
JSBSIM_IMPORT: Final = 4

#: Names of versions that the product itself moves.
RELEASED: Final = "released"
CANDIDATE: Final = "candidate"
#: Line of a version (`AeroDatabase.line`) -> these names in it.
NAMES: Final = {
    "": {RELEASED: RELEASED, CANDIDATE: CANDIDATE},
    "friction": {RELEASED: "released-friction", CANDIDATE: "candidate-friction"},
    "wake": {RELEASED: "released-wake", CANDIDATE: "candidate-wake"},
}
#: Names of the lines that are no vehicle's.
OF_LINES: Final = tuple(own for line, names in NAMES.items() if line for own in names.values())
