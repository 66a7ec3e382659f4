"""Per-flight estimates of every hypothesis given a model, and their test over flights.

`campaign` puts the normal equations of several flights on one order of columns (`Campaign`).
`Campaign.flight_estimates(accepted, freed)` gives each flight's estimate and information of every
hypothesis beside the accepted terms and the sensors (`FlightEstimates`). `over_flights` tests them
(`Tested`): mean, standard error, systematic bound, p, intervals.

Modules: `campaigns` and `products` (columns aligned, intercepts projected out, scaled),
`elimination` and `kernels` (nuisance parameters eliminated; compiled), `per_flight` (estimates and
their biases), `significance` (the test over flights, Holm). The method:
docs/method/tracing.md, sections 7 and 8.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .campaigns import OFFSET, campaign
    from .elimination import prepare_elimination
    from .per_flight import Campaign, FlightEstimates
    from .significance import (
        POWER,
        Tested,
        by_families,
        coherent_gain,
        holm,
        over_flights,
        paired_p,
        scatter_p,
    )

__getattr__, __dir__, __all__ = attach(__name__, __file__)
