from .air import air_suspicions
from .database import against_database
from .every import against_vehicle, examine, examined_beside, limited_document, limits_flight
from .plausibility import start_suspicions

__all__ = [
    "against_database",
    "against_vehicle",
    "air_suspicions",
    "examine",
    "examined_beside",
    "limited_document",
    "limits_flight",
    "start_suspicions",
]
