from .comparison import Comparison, band_limited, compare, with_flow_rates, with_states
from .total import (
    DEFAULT_BANDWIDTH,
    Coefficients,
    bandwidth_of,
    inertial_moment,
    specific_force_at_cg,
    thrust_loads,
    total_coefficients,
)

__all__ = [
    "DEFAULT_BANDWIDTH",
    "Coefficients",
    "Comparison",
    "band_limited",
    "bandwidth_of",
    "compare",
    "inertial_moment",
    "specific_force_at_cg",
    "thrust_loads",
    "total_coefficients",
    "with_flow_rates",
    "with_states",
]
