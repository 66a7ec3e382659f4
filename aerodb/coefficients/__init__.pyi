from .comparison import (
    FLOW_RATES,
    Comparison,
    DatabaseSide,
    as_inputs,
    band_limited,
    compare,
    rate_bandwidth,
    with_flow_rates,
    with_states,
)
from .inputs import UNHOLDABLE, InputUse, held_inputs, input_uses, lacking_inputs, with_held_inputs
from .thrust import THRUST_REMEDY, thrust_loads, thrust_share
from .total import DEFAULT_BANDWIDTH, Coefficients, bandwidth_of, total_coefficients

__all__ = [
    "DEFAULT_BANDWIDTH",
    "FLOW_RATES",
    "THRUST_REMEDY",
    "UNHOLDABLE",
    "Coefficients",
    "Comparison",
    "DatabaseSide",
    "InputUse",
    "as_inputs",
    "band_limited",
    "bandwidth_of",
    "compare",
    "held_inputs",
    "input_uses",
    "lacking_inputs",
    "rate_bandwidth",
    "thrust_loads",
    "thrust_share",
    "total_coefficients",
    "with_flow_rates",
    "with_held_inputs",
    "with_states",
]
