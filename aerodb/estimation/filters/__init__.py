"""Estimation in turbulence: Kalman filters whose likelihood or states hold the parameters.

1. A model that is not linear is linearised along the motion that the filter sees
   (`linearisation`, `one_step`).
2. `filtering` runs the filter (`filter_kernels`, compiled) for several sets of parameters at once.
3. `filter_problem` makes a likelihood of it, which `scoring` climbs for `filter_error`;
   `filter_fit` says what each estimate is worth.
4. `extended_kalman` and `unscented_kalman` (`kalman`, `kalman_fit`) carry the parameters as states.
5. `output_or_filter_error` (`process_noise`) recommends one of the two: a `Recommendation`.

Before: `aerodb.estimation.output_error`. Method and references: docs/method/estimation.md.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .filter_error import filter_error
    from .kalman import extended_kalman, unscented_kalman
    from .process_noise import Recommendation, output_or_filter_error

__getattr__, __dir__, __all__ = attach(__name__, __file__)
