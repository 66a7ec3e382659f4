"""Order of the numbers that the compiled simulation reads and writes."""

from typing import Final, NamedTuple

from aerodb.support import Array, Integers
from aerodb.tables import Instructions

#: State of a run: velocity over the earth in body axes [m/s], rates relative to inertial space
#: [rad/s], quaternion body to earth, position from the local origin [m]; then the states of the
#: database and the positions of the actuators.
STATE: Final = (
    "u", "v", "w", "p", "q", "r", "e0", "e1", "e2", "e3", "north", "east", "down",
)  # fmt: skip

#: Channels of the motion that a database may read, and that are recorded.
MOTION: Final = (
    "V", "alpha", "beta", "alphadot", "betadot", "p", "q", "r", "rho", "qbar", "mach",
    "temperature", "static_pressure", "altitude", "phi", "theta", "psi", "north", "east",
    "velocity_north", "velocity_east", "velocity_down", "height_above_ground",
)  # fmt: skip

#: Recorded beside them: specific force at the CG, angular acceleration, coefficients about the
#: database's moment reference.
LOADS: Final = (
    "ax", "ay", "az", "pdot", "qdot", "rdot", "CX", "CY", "CZ", "Cl", "Cm", "Cn",
)  # fmt: skip

#: What acts on a run beside the inputs of its database: mass properties (cg from the vehicle's
#: datum), moving air (wind over the earth, gust in body axes), density over that of the standard
#: atmosphere, temperature above it, a further force [N] and its moment about the CG [N m] in body
#: axes, and the altitude of the ground.
SURROUNDINGS: Final = (
    "mass", "cg_x", "cg_y", "cg_z", "Ixx", "Iyy", "Izz", "Ixz", "wind_north", "wind_east",
    "wind_down", "gust_u", "gust_v", "gust_w", "density_ratio", "temperature_offset", "force_x",
    "force_y", "force_z", "moment_x", "moment_y", "moment_z", "ground_altitude", "Ixy", "Iyz",
)  # fmt: skip

#: The further force and moment among them, to which feedback may go.
FURTHER_LOADS: Final = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")

#: Channels that feedback may use.
FEEDBACK: Final = ("V", "alpha", "beta", "p", "q", "r", "phi", "theta")


class Numbers(NamedTuple):
    """A vehicle and its database in numbers.

    program : the database's instructions.
    motion : slot of each of `MOTION`, -1 where the database does not read it.
    surroundings : slot of each of `SURROUNDINGS` that it reads (`cg_x`), else -1.
    inputs : (i,) slots of the inputs.
    totals : (6,) slots of the coefficients.
    states, steady : (m,) slots of the values and steady values of its states.
    laws : (m, 4) relaxation length [m], or 0 and a relay's low, high and value when separated.
    thrust : (e,) slots of the thrust of each engine [N].
    lines : (e, 6) unit vector and point [m] of each engine's thrust, from the vehicle's datum.
    actuated : (a,) numbers of the inputs behind an actuator.
    actuators : (a, 4) lower and upper limit, rate limit, lag [s].
    gains : (g, 3) number of the input, or of the load in `SURROUNDINGS` less their count; number in
        `FEEDBACK`; gain.
    reference : (6,) area, chord, span, moment reference from the datum.
    earth : (6,) 1 where it rotates, gravity of the flat earth, latitude, height, metres per radian
        of latitude and of longitude at the origin.
    layers : (l, 6) of the standard atmosphere.
    """

    program: Instructions
    motion: Integers
    surroundings: Integers
    inputs: Integers
    totals: Integers
    states: Integers
    steady: Integers
    laws: Array
    thrust: Integers
    lines: Array
    actuated: Integers
    actuators: Array
    gains: Array
    reference: Array
    earth: Array
    layers: Array
