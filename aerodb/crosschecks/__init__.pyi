from .air import air_suspicions
from .every import against_vehicle, limits_flight

__all__ = ["against_vehicle", "air_suspicions", "limits_flight"]
