from . import schema
from .catalogue import Catalogue
from .copying import copy_catalogue
from .file_identity import StoredFile, measured
from .flight_pages import RETRACTED, FlightFilter
from .ledger import Ledger
from .location import CatalogueLocation, catalogue_location
from .names import standing_moves
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
from .schema import HEAD, POSTGRESQL_REFUSAL, VERDICTS, append_only_triggers

__all__ = [
    "HEAD",
    "POSTGRESQL_REFUSAL",
    "RETRACTED",
    "VERDICTS",
    "CalibrationRow",
    "Catalogue",
    "CatalogueLocation",
    "FlightFilter",
    "FlightRole",
    "FlightRow",
    "Impact",
    "InboxEvent",
    "InboxKind",
    "Ledger",
    "Lineage",
    "NameEvent",
    "RepeatRow",
    "ResultRow",
    "RunRow",
    "RunState",
    "StoredFile",
    "Stretch",
    "VersionDocuments",
    "VersionRow",
    "append_only_triggers",
    "catalogue_location",
    "copy_catalogue",
    "measured",
    "schema",
    "standing_moves",
]
