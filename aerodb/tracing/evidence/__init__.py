"""One flight: residual and regressor columns, conditioned, whitened, and multiplied.

`evidence_of` gives the residual and the column of each hypothesis (`Evidence`). `noisy_copies`,
`with_shape_terms` and `with_instruments` add to it; `units` cuts it into manoeuvres. `in_band`
low-passes and decimates it (`BandLimitedFlight`), and `normal_equations_of` whitens the columns and
returns their cross-products (`FlightNormalEquations`), which is all that later steps need.

Modules: `flight_evidence` and `evidence`, `thinning` (long flights at a lower rate), `bandwidth`
and `low_pass`, `autoregression` and `normal_equations`; `state_errors` and `noise_limits` (errors
of reconstructed states), `shape_misfit` (templates of the wrong shape), `instrumental_variables`
(commanded inputs), `sampling_unit` (names of flights and of stretches of them). The method:
docs/method/tracing.md, sections 3 to 6 and 17 to 21.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .bandwidth import tracing_bandwidth
    from .evidence import NUISANCE, Evidence, halves, units
    from .flight_evidence import evidence_of
    from .instrumental_variables import with_commanded_rates, with_instruments
    from .low_pass import BandLimitedFlight, Records, band_limited, in_band, stretches
    from .noise_limits import bounded_noise, with_air_data_noise, with_deflection_noise
    from .normal_equations import (
        FlightNormalEquations,
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
    from .state_errors import noisy_copies, roll_rates, rotating_air
    from .thinning import LONG, thinned

__getattr__, __dir__, __all__ = attach(__name__, __file__)
