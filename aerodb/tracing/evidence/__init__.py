"""One flight: residual and regressor columns, conditioned, whitened, and multiplied.

`evidence_of` gives the residual and the column of each hypothesis (`Evidence`). `noisy_copies`,
`with_shape_terms` and `with_instruments` add to it; `units` cuts it into manoeuvres. `in_band`
low-passes and decimates it (`Band`), and `normal_equations_of` whitens the columns and returns
their cross-products (`NormalEquations`), which is all that later steps need.

Modules: `flight_evidence` and `evidence`, `thinning` (long flights at a lower rate), `bandwidth`
and `low_pass`, `autoregression` and `normal_equations`; `state_errors` and `noise_limits` (errors
of reconstructed states), `shape_misfit` (templates of the wrong shape), `instrumental_variables`
(commanded inputs), `sampling_unit` (names of flights and of stretches of them). The method:
docs/method/tracing.md, sections 3 to 6 and 17 to 21.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
