"""Linear models with named entries, and start values for them.

1. `state_space` makes a linear `StateSpace` model of named entries (`affine`), each a sum of
   parameters, simulated exactly (`recursion` is its compiled loop). `stabilised` feeds measured
   outputs back into an unstable one.
2. `with_delays` lets inputs act and outputs be measured late: a `DelayedStateSpace`.
3. `subspace` identifies a linear model of records without any start values, and says how its order
   came about; `structure_matching` brings it into the form of a declared model.
4. `with_start_values` and `with_regressed_start_values` (`start_values`) give a declared model the
   start values that the records show.

Next: `aerodb.estimation.output_error` and `aerodb.estimation.filters` estimate the parameters.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .affine import AffineMatrix, affine_matrix
    from .delays import MOST_DELAY, DelayedStateSpace, delayed, with_delays
    from .start_values import (
        FROM_SUBSPACE,
        LinearModel,
        has_start_values,
        with_regressed_start_values,
        with_start_values,
    )
    from .state_space import StateSpace, stabilised, state_space

__getattr__, __dir__, __all__ = attach(__name__, __file__)
