from .campaigns import OFFSET, campaign
from .covariance import joint_covariance
from .per_flight import Campaign, FlightEstimates
from .significance import POWER, Tested, coherent_gain, holm, over_flights, paired_p

__all__ = [
    "OFFSET",
    "POWER",
    "Campaign",
    "FlightEstimates",
    "Tested",
    "campaign",
    "coherent_gain",
    "holm",
    "joint_covariance",
    "over_flights",
    "paired_p",
]
