from .air import air_suspicions
from .database import against_database
from .every import against_vehicle, examined_beside, limited_document, limits_flight

__all__ = [
    "against_database",
    "against_vehicle",
    "air_suspicions",
    "examined_beside",
    "limited_document",
    "limits_flight",
]
