"""JSON Schemas of what commands answer with ``--json`` (docs/reference/contract.md, section JSON).

Keys beyond those described may be added; those here stay. Quantities are in SI units.

`ANSWERS` names the form of each command's answer, `schema_of` writes its schema. Forms are in
`flights`, `versions`, `results` and `upkeep`; the console's API describes its answers with these.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .common import Answer
    from .flights import ListedFlight, ShownFlight
    from .schemas import ANSWERS, schema_of
    from .versions import Evaluated, ListedVehicle, Move, Version

__getattr__, __dir__, __all__ = attach(__name__, __file__)
