"""What looks wrong in a flight, by itself and against its vehicle, before estimation.

`examine` returns the findings on a flight by itself: suspected faults of sign, unit and wiring
(`plausibility`, `hypotheses`), with its segments and delays. Then physics, beside its vehicle,
where that is known:

1. `air`: density, pressure, temperature, altitude, airspeed, dynamic pressure, each against the
   others.
2. `masses`: mass, inertia, centre of gravity and reference lengths against each other.
3. `lift`: the weight and the lift slope against what a wing of this size and shape can have.
4. `drag`: where thrust is logged, the sign of the drag that it leaves.
5. `vane`: the angle of attack against that of rates and accelerations.
6. `mass_events`: a mass that leaves or comes aboard, and, beside a database, how the CG moves.
7. `controls`: each surface against the motion that it causes: size, sign, effect, delay
   (`surfaces`, `equation_error`).
8. `commands`: the command of each rotor: logged, moving and within its range.
9. `database`: a flight against its vehicle's database, once there is one: level and slope of the
   lift, sign, size and delay of each control, a factor that all moments share (`derivatives`),
   aileron and rudder exchanged (`exchanged`), mass, CG and thrust (`loads`), a rotor
   that thrusts less or more than the others (`rotors`), rotors in another order (`rotor_order`).

`against_vehicle` runs the first eight and `against_database` the last. They return suspicions
(`aerodb.conditioning.Suspicion`), and `limits_flight` says which of these limit the verdict. The
margins are those of aircraft of all sizes, and nothing is said where a flight cannot decide.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .air import air_suspicions
    from .database import against_database
    from .every import against_vehicle, examine, limited_document, limits_flight
    from .plausibility import start_suspicions
    from .rotors import BATTERY, rotor_suspicions, speed_by_voltage

__getattr__, __dir__, __all__ = attach(__name__, __file__)
