from . import schema
from .catalogue import Catalogue
from .copying import copy_catalogue
from .flight_pages import RETRACTED, Asked
from .ledger import Ledger
from .names import standing_moves
from .places import Place, place_of
from .rows import (
    CalibrationRow,
    FlightRole,
    FlightRow,
    Impact,
    InboxEvent,
    InboxKind,
    Lineage,
    NameEvent,
    RepeatRow,
    ResultRow,
    RunRow,
    RunState,
    Stretch,
    VersionDocuments,
    VersionRow,
)
from .schema import HEAD, POSTGRESQL_REFUSAL, VERDICTS, guards
from .stored_files import StoredFile, measured

__all__ = [
    "HEAD",
    "POSTGRESQL_REFUSAL",
    "RETRACTED",
    "VERDICTS",
    "Asked",
    "CalibrationRow",
    "Catalogue",
    "FlightRole",
    "FlightRow",
    "Impact",
    "InboxEvent",
    "InboxKind",
    "Ledger",
    "Lineage",
    "NameEvent",
    "Place",
    "RepeatRow",
    "ResultRow",
    "RunRow",
    "RunState",
    "StoredFile",
    "Stretch",
    "VersionDocuments",
    "VersionRow",
    "copy_catalogue",
    "guards",
    "measured",
    "place_of",
    "schema",
    "standing_moves",
]
