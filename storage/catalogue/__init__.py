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

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
