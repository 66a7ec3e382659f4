"""Order of the numbers that the compiled simulation reads and writes."""

from typing import Any, Final, NamedTuple, TypeVar

from aerodb.support import Array, Integers
from aerodb.tables import Instructions

_Rows = TypeVar("_Rows", bound=Any)


class _State(NamedTuple):
    """Rows of the state of a run: velocity over the earth in body axes [m/s], rates relative to
    inertial space [rad/s], quaternion body to earth, position from the local origin [m]. The states
    of the database and the positions of the actuators follow."""

    u: int
    v: int
    w: int
    p: int
    q: int
    r: int
    e0: int
    e1: int
    e2: int
    e3: int
    north: int
    east: int
    down: int


class _Channels(NamedTuple):
    """Rows of what is recorded: the motion, which a database may read, then specific force at the
    CG, angular acceleration, and coefficients about the database's moment reference."""

    V: int
    alpha: int
    beta: int
    alphadot: int
    betadot: int
    p: int
    q: int
    r: int
    rho: int
    qbar: int
    mach: int
    temperature: int
    static_pressure: int
    altitude: int
    phi: int
    theta: int
    psi: int
    north: int
    east: int
    velocity_north: int
    velocity_east: int
    velocity_down: int
    height_above_ground: int
    ax: int
    ay: int
    az: int
    pdot: int
    qdot: int
    rdot: int
    CX: int
    CY: int
    CZ: int
    Cl: int
    Cm: int
    Cn: int


class _Surroundings(NamedTuple):
    """Rows of what acts on a run in addition to the inputs of its database, which follow, as do
    references of feedback: mass properties (cg from the vehicle's datum), moving air (wind over the
    earth; gust and rotation of the air in body axes), density over that of the standard atmosphere,
    temperature above it, a further force [N] and its moment about the CG [N m] in body axes, and
    the ground's altitude."""

    mass: int
    cg_x: int
    cg_y: int
    cg_z: int
    Ixx: int
    Iyy: int
    Izz: int
    Ixz: int
    wind_north: int
    wind_east: int
    wind_down: int
    gust_u: int
    gust_v: int
    gust_w: int
    gust_p: int
    gust_q: int
    gust_r: int
    density_ratio: int
    temperature_offset: int
    force_x: int
    force_y: int
    force_z: int
    moment_x: int
    moment_y: int
    moment_z: int
    ground_altitude: int
    Ixy: int
    Iyz: int


class _Work(NamedTuple):
    """Rows of what the equations need in between: in body axes gravity, the rate of the earth and
    that of the local earth axes, the rate of the air's velocity; rates of position; velocity
    through the air; rate of the velocity over the earth; moment about the CG. For the search of
    alphadot and betadot the slope of each gap, the gap and the last change."""

    gravity_x: int
    gravity_y: int
    gravity_z: int
    earth_p: int
    earth_q: int
    earth_r: int
    frame_p: int
    frame_q: int
    frame_r: int
    air_u_rate: int
    air_v_rate: int
    air_w_rate: int
    north_rate: int
    east_rate: int
    down_rate: int
    air_u: int
    air_v: int
    air_w: int
    u_rate: int
    v_rate: int
    w_rate: int
    moment_x: int
    moment_y: int
    moment_z: int
    slope: int
    slope_slip: int
    gap: int
    gap_slip: int
    moved: int
    moved_slip: int


class _Totals(NamedTuple):
    """Numbers of the coefficients."""

    CX: int
    CY: int
    CZ: int
    Cl: int
    Cm: int
    Cn: int


class _Line(NamedTuple):
    """Columns of the line of an engine's thrust: unit vector, point from the datum [m]."""

    x: int
    y: int
    z: int
    point_x: int
    point_y: int
    point_z: int


class _Law(NamedTuple):
    """Columns of the law of a state: relaxation length [m]; negative where the rate is computed; or
    0 and a relay's values of alpha [rad] and its value when separated."""

    relaxation: int
    low: int
    high: int
    separated: int


class _Gain(NamedTuple):
    """Columns of a gain of feedback: number of the input, or of the load in `SURROUNDINGS` less
    their count; number in `FEEDBACK`; gain."""

    number: int
    channel: int
    gain: int


class ReferenceNumbers(NamedTuple):
    """Reference area [m2] and lengths [m], moment reference from the datum [m]; constant pressure
    [Pa] of the coefficients, 0 where it is the dynamic pressure."""

    area: float
    chord: float
    span: float
    x: float
    y: float
    z: float
    pressure: float


class EarthNumbers(NamedTuple):
    """Whether the earth rotates, gravity of the flat one [m/s2], latitude [rad], height [m] and
    metres per radian of latitude and longitude at the origin."""

    rotates: bool
    gravity: float
    latitude: float
    height: float
    metres_north: float
    metres_east: float


def _numbered(rows: type[_Rows]) -> _Rows:
    return rows(*range(len(rows._fields)))


#: The number of each row by its name: ``x[X.u]``, ``chan[CHAN.alpha]``, ``h[H.mass]``,
#: ``work[WORK.moment_x]``; constants in compiled functions. A new row may stand anywhere.
X: Final = _numbered(_State)
CHAN: Final = _numbered(_Channels)
H: Final = _numbered(_Surroundings)
WORK: Final = _numbered(_Work)
TOTAL: Final = _numbered(_Totals)
LINE: Final = _numbered(_Line)
LAW: Final = _numbered(_Law)
GAIN: Final = _numbered(_Gain)

STATE: Final = _State._fields
#: Channels of the motion that a database may read, and those recorded beside them.
MOTION: Final = _Channels._fields[: CHAN.ax]
LOADS: Final = _Channels._fields[CHAN.ax :]
SURROUNDINGS: Final = _Surroundings._fields
#: First row of the inputs among what acts, and of the further states.
INPUTS: Final = len(H)
EXTRA: Final = len(X)

#: The further force and moment among them, to which feedback may go.
FURTHER_LOADS: Final = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")

#: Channels that feedback may use.
FEEDBACK: Final = ("V", "alpha", "beta", "p", "q", "r", "phi", "theta")
#: Their rows.
FEEDBACK_ROWS: Final = tuple(MOTION.index(name) for name in FEEDBACK)


class Numbers(NamedTuple):
    """A vehicle and its database in numbers.

    program : the database's instructions.
    motion : slot of each of `MOTION`, -1 where the database does not read it.
    surroundings : slot of each of `SURROUNDINGS` that it reads (`cg_x`), else -1.
    inputs : (i,) slots of the inputs.
    totals : (6,) slots of the coefficients without loads, in the order of `TOTAL`.
    loads : (6,) slots of forces [N] and moments [N m], in the same order; (0,) without any.
    states, steady : (m,) slots of the values and steady values of its states; of a state with a
        rate that rate [1/s].
    laws : (m, 4) columns `LAW`.
    thrust : (e,) slots of the thrust of each engine [N].
    lines : (e, 6) columns `LINE`.
    actuated : (a,) numbers of the inputs behind an actuator.
    actuators : (a, 4) lower and upper limit, rate limit, lag [s].
    gains : (g, 3) columns `GAIN`.
    layers : (l, 6) of the standard atmosphere.
    """

    program: Instructions
    motion: Integers
    surroundings: Integers
    inputs: Integers
    totals: Integers
    loads: Integers
    states: Integers
    steady: Integers
    laws: Array
    thrust: Integers
    lines: Array
    actuated: Integers
    actuators: Array
    gains: Array
    reference: ReferenceNumbers
    earth: EarthNumbers
    layers: Array
