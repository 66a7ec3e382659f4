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

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .aircraft_files import files_beside
    from .cache import (
        concurrently,
        is_available,
        is_recording_available,
        local,
        local_recording,
        put,
        put_recording,
    )
    from .documents import read_document, write_document
    from .flight_windows import StoredSeries
    from .flights import (
        INDEX,
        files_of,
        open_recording,
        read_flight,
        read_recording,
        read_results,
        topic_paths,
        write_flight,
        write_results,
        write_topics,
    )
    from .normal_equations import read_normal_equations, write_normal_equations
    from .objects import DamagedObject, Objects, objects_of
    from .transfer import (
        STORE,
        Part,
        TransferReport,
        is_sound,
        parts,
        pull,
        push,
        remove_abandoned,
        trim,
    )

__getattr__, __dir__, __all__ = attach(__name__, __file__)
