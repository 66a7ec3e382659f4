"""Which aerodynamic code wrote a file, by its content, and its database."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from aerodb.exchange.aero_codes.answers import Answers, KnownVehicle
from aerodb.exchange.aero_codes.avl import import_avl, is_avl
from aerodb.exchange.aero_codes.datcom import import_datcom, is_datcom
from aerodb.exchange.aero_codes.gazebo import import_gazebo, is_gazebo
from aerodb.exchange.aero_codes.sitl import import_sitl, is_sitl
from aerodb.exchange.aero_codes.sweep import import_sweep
from aerodb.exchange.aero_codes.vspaero import import_polar, import_stab, is_polar, is_stab
from aerodb.exchange.aero_codes.xflr5 import import_xflr5, is_xflr5
from aerodb.exchange.aero_codes.xflr5_stability import import_stability, is_stability
from aerodb.tables import AeroDatabase

Importer = Callable[[Sequence[tuple[str, bytes]], str, Answers], AeroDatabase]

#: Name of a code -> how its files are told, by their text, and read.
_CODES: Final[dict[str, tuple[Callable[[str], bool], Importer]]] = {
    "AVL": (is_avl, import_avl),
    "ArduPilot SITL": (is_sitl, import_sitl),
    "Gazebo AdvancedLiftDrag": (is_gazebo, import_gazebo),
    "VSPAERO stability": (is_stab, import_stab),
    "VSPAERO polar": (is_polar, import_polar),
    "XFLR5": (is_xflr5, import_xflr5),
    "XFLR5 stability": (is_stability, import_stability),
    "Datcom": (is_datcom, import_datcom),
}


def code_of(data: bytes) -> str:
    """Return the name of the code that wrote a file; '' where none is known."""
    text = data[:200_000].decode("utf-8-sig", "replace")
    return next((name for name, (fits, _) in _CODES.items() if fits(text)), "")


def import_code(
    files: Sequence[tuple[str, bytes]],
    name: str,
    *,
    bindings: Mapping[str, str] | None = None,
    vehicle: KnownVehicle | None = None,
) -> AeroDatabase:
    """Return the database of one or several files (name, content) of one aerodynamic code.

    bindings : answers to questions, and controls as expressions of channels in the unit of the file
    (docs/reference/aerodynamic-codes.md). vehicle : what is proposed. How the file was read is in
    the database's description, a line for each statement.

    A file of no known code (`code_of`) is read as a sweep: a table of points. Raises InputError
    with file and line for what cannot be read, and OpenQuestionsError with all that is open.
    """
    code = code_of(files[0][1])
    importer = _CODES[code][1] if code else import_sweep
    answers = Answers(bindings or {}, files[0][0], vehicle or KnownVehicle())
    return importer(files, name, answers)
