"""Total aerodynamic coefficients of a flight, and their comparison with a database.

The way through:

1. `total_coefficients` solves Newton and Euler for the aerodynamic part and gives `Coefficients`:
   CX CY CZ Cl Cm Cn with standard deviations and usable samples. Its building blocks are
   `thrust_loads` and the motion of a rigid body (`aerodb.physics`); `bandwidth_of` chooses the
   bandwidth of differentiated rates (`DEFAULT_BANDWIDTH`).
2. `compare` puts them beside a database's prediction in the database's reference geometry and gives
   a `Comparison`, whose `residual` is measured - predicted. `with_states` integrates the database's
   state models along the flight; `band_limited` limits whatever is compared with moments.

3. `lacking_inputs` names what a database needs and flights lack, `with_held_inputs` holds it at
   zero, and `input_uses` says what each `InputUse` changes. `without_values` and `divisors` say
   which coefficients a database has no value of, and which inputs must not be held.

A flight that lacks the thrust which its vehicle logs has no axis that contains thrust
(`thrust_share`, THRUST_REMEDY).

`rotors_beside` compares a flight of a vehicle that rotors carry, and says what its rotors and its
battery do otherwise than the database.

`thinned_comparison` takes a long flight to the rate that its band needs.

`total` holds the coefficients, `angular_acceleration` the choice between logged angular
accelerations and rates differentiated, `thrust` the thrust, `comparison` the comparison,
`thinning` fewer samples, `inputs` the inputs that flights lack, `finite` whether a database has
values.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .comparison import (
        FLOW_RATES,
        Comparison,
        as_inputs,
        band_limited,
        compare,
        rate_bandwidth,
        with_flow_rates,
        with_states,
    )
    from .finite import divisors, without_values
    from .inputs import (
        UNHOLDABLE,
        InputUse,
        held_inputs,
        input_uses,
        lacking_inputs,
        with_held_inputs,
    )
    from .rotors import rotors_beside
    from .thinning import BRIDGED, LONG, OVERSAMPLING, clear, spacing, thinned_comparison
    from .thrust import THRUST_REMEDY, thrust_loads, thrust_share
    from .total import DEFAULT_BANDWIDTH, Coefficients, bandwidth_of, total_coefficients

__getattr__, __dir__, __all__ = attach(__name__, __file__)
