"""Output error: the parameters whose simulated outputs are most likely.

1. `sensitivities` are the derivatives of the outputs, by the model itself or by runs side by side.
2. `likelihood` weights them by the measurement noise, which is estimated too.
3. `search` (`gauss_newton`) climbs the likelihood; `output_error` says what each estimate is worth.
4. `instability` tells when an unstable motion needs `stabilised` models or `multiple_shooting`,
   which gives each segment of a record its own initial state.
5. `nonlinear_refinement` searches within bounds from several starts, with a cost of three parts.
6. `frequency_domain_output_error` compares transforms over a band: linear models, unstable too.

Before: `aerodb.estimation.linear_models`. With turbulence: `aerodb.estimation.filters`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .gauss_newton import projected, search
    from .in_band import frequency_domain_output_error
    from .likelihood import no_equations
    from .multiple_shooting import multiple_shooting
    from .output_error import output_error
    from .refinement import nonlinear_refinement
    from .sensitivities import acting

__getattr__, __dir__, __all__ = attach(__name__, __file__)
