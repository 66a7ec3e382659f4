from .campaigns import OFFSET, campaign
from .covariance import joint_covariance
from .per_flight import Campaign, FlightEstimates
from .significance import POWER, Tested, by_families, coherent_gain, holm, over_flights, paired_p

__all__ = [
    "OFFSET",
    "POWER",
    "Campaign",
    "FlightEstimates",
    "Tested",
    "by_families",
    "campaign",
    "coherent_gain",
    "holm",
    "joint_covariance",
    "over_flights",
    "paired_p",
]
