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
from .transfer import STORE, Part, TransferReport, is_sound, parts, pull, push, require_unused, trim

__all__ = [
    "INDEX",
    "STORE",
    "DamagedObject",
    "Objects",
    "Part",
    "StoredSeries",
    "TransferReport",
    "concurrently",
    "files_beside",
    "files_of",
    "is_available",
    "is_recording_available",
    "is_sound",
    "local",
    "local_recording",
    "objects_of",
    "open_recording",
    "parts",
    "pull",
    "push",
    "put",
    "put_recording",
    "read_document",
    "read_flight",
    "read_normal_equations",
    "read_recording",
    "read_results",
    "require_unused",
    "topic_paths",
    "trim",
    "write_document",
    "write_flight",
    "write_normal_equations",
    "write_results",
    "write_topics",
]
