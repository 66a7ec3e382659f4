from .bandwidth import tracing_bandwidth
from .evidence import NUISANCE, Evidence, halves, units
from .flight_evidence import evidence_of
from .instrumental_variables import with_commanded_rates, with_instruments
from .low_pass import Band, Records, band_limited, in_band, stretches
from .noise_limits import bounded_noise, with_air_data_noise
from .normal_equations import (
    NormalEquations,
    normal_equations_from_arrays,
    normal_equations_of,
    normal_equations_of_band,
)
from .sampling_unit import SamplingUnit
from .shape_misfit import (
    TOLERANCE,
    parent,
    shape_term_columns,
    with_shape_terms,
    without_shape_terms,
)
from .state_errors import noisy_copies, roll_rates
from .thinning import LONG, thinned

__all__ = [
    "LONG",
    "NUISANCE",
    "TOLERANCE",
    "Band",
    "Evidence",
    "NormalEquations",
    "Records",
    "SamplingUnit",
    "band_limited",
    "bounded_noise",
    "evidence_of",
    "halves",
    "in_band",
    "noisy_copies",
    "normal_equations_from_arrays",
    "normal_equations_of",
    "normal_equations_of_band",
    "parent",
    "roll_rates",
    "shape_term_columns",
    "stretches",
    "thinned",
    "tracing_bandwidth",
    "units",
    "with_air_data_noise",
    "with_commanded_rates",
    "with_instruments",
    "with_shape_terms",
    "without_shape_terms",
]
