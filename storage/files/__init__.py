"""Stored files: flights, recordings, results and documents, on disk or in an object store.

Write a file with `write_flight`, `write_results`, `write_topics`, `write_normal_equations` or
`write_document`; then upload it with `put` or `put_recording`; then add its row to the catalogue.
Read it at the path that `local` or `local_recording` returns, which download it if necessary, with
the matching `read_...` function, or `StoredSeries` for parts of a time series. Without an object
store, `put` and `local` do nothing.

- `flights`, `topics`, `normal_equations`, `documents`: contents; `parquet`: the file format;
  `flight_windows`: parts of stored series.
- `objects`: objects of an S3 service (`Objects`, `objects_of`); `cache`: the workspace folder as
  their cache; `transfer`: the whole store at once (`push`, `pull`, `trim`).
- `aircraft_files`: files that a JSBSim aircraft refers to (`files_beside`).
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
