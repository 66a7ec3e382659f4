from .comparison import Comparison, band_limited, compare, with_flow_rates, with_states
from .thrust import THRUST_REMEDY, thrust_loads, thrust_share
from .total import (
    DEFAULT_BANDWIDTH,
    Coefficients,
    bandwidth_of,
    inertial_moment,
    specific_force_at_cg,
    total_coefficients,
)

__all__ = [
    "DEFAULT_BANDWIDTH",
    "THRUST_REMEDY",
    "Coefficients",
    "Comparison",
    "band_limited",
    "bandwidth_of",
    "compare",
    "inertial_moment",
    "specific_force_at_cg",
    "thrust_loads",
    "thrust_share",
    "total_coefficients",
    "with_flow_rates",
    "with_states",
]
