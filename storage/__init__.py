"""Storage: the workspace folder, the catalogue, stored files, log readers and export writers.

The only layer that reads and writes files, SQL databases and object stores; the packages below it
(`aerodb.tables`, `aerodb.tracing`, ...) work on values in memory. The way through:

1. `workspace.Workspace.open` gives the folder with everything in it; `workspace_settings` reads its
   ``settings.toml``, `limits` the section on resource limits.
2. `catalogue.Catalogue.open` gives the database of vehicles, logs, flights, results, versions and
   runs (SQLite file or PostgreSQL). `migrations` holds its schema changes.
3. `inbox` finds logs that wait to be ingested and manages quarantine and notifications.
4. `readers.read_log` parses a log into a `Recording`;
   `mappings.load_mapping` says which field of the log is which channel.
5. `files` stores flights, recordings, results and documents, in the folder or in an object store.
6. `writers` writes ULog files and PROV-JSON, and checks exports in JSBSim, in another process.
7. `upkeep` verifies, backs up and restores a workspace.

Shared by these: `encoding` (values as database columns), `locks` (file locks), `urls` (database
addresses), `confinement` (limits of processes that may fail), `disk_errors` and `database_errors`
(system errors as `StoreError` with a remedy).
"""
