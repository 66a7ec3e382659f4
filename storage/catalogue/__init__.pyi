from . import schema
from .catalogue import Catalogue
from .chain import broken_links, has_link, link_rows, newest_link
from .copying import copy_catalogue
from .file_identity import StoredFile, measured
from .flight_pages import RETRACTED, FlightFilter
from .ledger import Ledger
from .location import CatalogueLocation, catalogue_location
from .names import standing_moves
from .row_links import broken_rows, link_stored_rows
from .rows import (
    CalibrationRow,
    FlightRole,
    FlightRow,
    Impact,
    InboxEvent,
    InboxKind,
    Lineage,
    NameEvent,
    NoteKind,
    NoteRow,
    RepeatRow,
    ResultRow,
    RunRow,
    RunState,
    Stretch,
    UserRole,
    UserRow,
    VersionDocuments,
    VersionRow,
)
from .schema import HEAD, POSTGRESQL_REFUSAL, USER_ROLES, VERDICTS, append_only_triggers
from .seal import is_intact, seal
from .sqlite import connected_to_read

__all__ = [
    "HEAD",
    "POSTGRESQL_REFUSAL",
    "RETRACTED",
    "USER_ROLES",
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
    "NoteKind",
    "NoteRow",
    "RepeatRow",
    "ResultRow",
    "RunRow",
    "RunState",
    "StoredFile",
    "Stretch",
    "UserRole",
    "UserRow",
    "VersionDocuments",
    "VersionRow",
    "append_only_triggers",
    "broken_links",
    "broken_rows",
    "catalogue_location",
    "connected_to_read",
    "copy_catalogue",
    "has_link",
    "is_intact",
    "link_rows",
    "link_stored_rows",
    "measured",
    "newest_link",
    "schema",
    "seal",
    "standing_moves",
]
