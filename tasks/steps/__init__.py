"""Steps of the flows: each loads its inputs, calls the science, and keeps the result.

A flight: `store_log` reads a log and stores its flight, `check_consistency` reconstructs it,
`reconstruct` computes its total coefficients, `compare_with_version` compares these with a database
version.

A database: `import_database` stores a baseline; `plan_update` splits flights into identification
and hold-out; `estimate` and `validate` fit and validate declared increments, `publish_candidate`
stores the new version. The closed loop uses `freeze_library`, `trace_flight`, `run_loop`,
`prove_loop` and `publish_loop` instead. `promote` and `roll_back` move names of versions,
`export_version` writes a version for a simulator.

Operation: `files_of_inbox`, `settle` and `set_aside` (the inbox), `due` (whether an update is due),
`tell` and `deliver` (notifications), `mark_ended` (crashed runs), `trim_cache` (object store).

A step takes ids and the keywords `workspace` (folder) and `run` (id of the run that stores its
result). Names of steps appear in progress output and in Prefect as ``module.function``.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
