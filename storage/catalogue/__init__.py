"""The catalogue: the database of everything a workspace knows.

`Catalogue.open(path)` opens the SQLite file of a workspace, or the PostgreSQL database that its
settings name (`catalogue_location` decides which), and migrates it to the newest schema. One class
offers all queries; its parts are in modules of their own:

- vehicles, logs, results and runs: `catalogue`, `run_queries`; flights: `flight_rows`,
  `flight_pages` (lists page by page, narrowed by a `FlightFilter`), `repeats`;
- versions: `versions`, `names` (``released``, ...), `lineage`, `version_queries`;
- `calibrations`, `stored_files` (hashes of files), `inbox_history` (what happened to files of the
  inbox).

Queries answer with the frozen rows of `rows`. `schema` defines the tables and their append-only
triggers; `database`, `sqlite` and `postgresql` the connections and transactions; `copying` copies a
whole catalogue between databases.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from . import schema
    from .catalogue import Catalogue
    from .chain import broken_links, has_link, link_rows, newest_link
    from .copying import copy_catalogue
    from .database import upgrade
    from .file_identity import StoredFile, measured
    from .flight_pages import RETRACTED, FlightFilter
    from .former_catalogue import FORMER
    from .ledger import Ledger
    from .location import SETTINGS_FILE, CatalogueLocation, catalogue_location
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
        RepeatedStretch,
        RepeatRow,
        ResultRow,
        RunRow,
        RunState,
        UserRole,
        VersionDocuments,
        VersionRow,
    )
    from .schema import HEAD, POSTGRESQL_REFUSAL, USER_ROLES, VERDICTS, append_only_triggers
    from .seal import is_intact, seal
    from .sqlite import connected_to_read

__getattr__, __dir__, __all__ = attach(__name__, __file__)
