"""Parameters that flight-path reconstruction can estimate: names, natural sizes and scopes.

- ``<channel>_bias``, ``_scale``, ``_delay``: of a sensor that shows ``(1 + scale) true(t - delay) +
  bias``. Bias and scale of a pressure altitude are the weather of a flight, not a sensor error.
- ``gps_delay``: of all channels of the antenna.
- ``wind_north``, ``_east``, ``_down``, ``terrain_elevation``: of a flight.
- ``air_data_x``, ``_y``, ``_z`` and ``gps_x``, ``_y``, ``_z``: corrections of the positions of
  air-data point and antenna.
- ``air_data_roll``, ``_pitch``, ``_yaw`` and ``beam_forward``, ``_right``: mounting of the boom and
  of the slant range's beam.
- ``static_port_error``, ``static_port_offset``, ``total_port_error``: of the pressures behind V,
  qbar and pressure altitude.
- ``probe_<angle>_offset``, ``_slope``, ``_square``, ``_cross``, ``_bend``: calibration of a
  five-hole probe (`aerodb.vehicle.five_hole`).
- ``initial_<state>``: of a record.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from aerodb.consistency.kinematics import INPUTS, STATES
from aerodb.errors import UnknownNameError, nearest
from aerodb.nomenclature import NAVIGATION

#: Channels that every reconstruction can compare with.
OUTPUTS: Final = (
    "V", "alpha", "beta", "qbar", "phi", "theta", "psi",
    "velocity_north", "velocity_east", "velocity_down", "north", "east", "altitude",
)  # fmt: skip

#: Channels that first need something declared or estimated: terrain, a calibration, the weather.
FURTHER_OUTPUTS: Final = (
    "pressure_altitude",
    "height_above_ground",
    "slant_range",
    "probe_dp_alpha",
    "probe_dp_beta",
)

#: Channels of the antenna, affected by its position and delay. A barometric altitude is called
#: ``pressure_altitude``.
GPS_OUTPUTS: Final = NAVIGATION

_CHANNELS: Final = (*INPUTS, *OUTPUTS, *FURTHER_OUTPUTS)

#: Air data: the channels affected by gusts.
AIR_DATA: Final = ("V", "alpha", "beta", "qbar", "probe_dp_alpha", "probe_dp_beta")

#: Natural size of a bias: the largest error of a serviceable sensor. A standard error below it is
#: informative, one beyond it is not.
_SIZE: Final[Mapping[str, float]] = {
    **dict.fromkeys(("ax", "ay", "az"), 0.5),
    **dict.fromkeys(("p", "q", "r"), 0.02),
    **dict.fromkeys(("alpha", "beta", "phi", "theta", "psi"), 0.03),
    **dict.fromkeys(("V", "velocity_north", "velocity_east", "velocity_down"), 3.0),
    **dict.fromkeys(("u", "v", "w"), 3.0),
    **dict.fromkeys(
        ("north", "east", "altitude", "pressure_altitude", "height_above_ground", "slant_range"),
        20.0,
    ),
    **dict.fromkeys(("qbar", "probe_dp_alpha", "probe_dp_beta"), 200.0),
}
#: Natural size of a scale error, relative.
_SCALE = 0.2
#: Natural size of a delay [s].
_DELAY = 0.2
#: Natural size of a component of the wind [m/s].
_WIND = 10.0
#: Natural size of an error of a lever arm [m].
_ARM = 1.0
#: Natural size of an angle of installation [rad].
_MOUNT = 0.03
#: Natural sizes of the errors of a five-hole probe's calibration.
_PROBE: Final = {"offset": 0.03, "slope": 0.2, "square": 0.5, "cross": 0.5, "bend": 0.2}

#: Further parameters: kind and natural size.
_OWN: Final[Mapping[str, tuple[str, float]]] = {
    "gps_delay": ("delay", _DELAY),
    "wind_north": ("wind", _WIND),
    "wind_east": ("wind", _WIND),
    "wind_down": ("wind", 0.2 * _WIND),
    "terrain_elevation": ("terrain", 500.0),
    "pressure_altitude_bias": ("weather", 300.0),
    "pressure_altitude_scale": ("weather", 0.1),
    **{f"{point}_{axis}": ("arm", _ARM) for point in ("air_data", "gps") for axis in "xyz"},
    **dict.fromkeys(
        ("air_data_roll", "air_data_pitch", "air_data_yaw", "beam_forward", "beam_right"),
        ("mount", _MOUNT),
    ),
    **dict.fromkeys(("static_port_error", "total_port_error"), ("port", 0.2)),
    "static_port_offset": ("port", 200.0),
    **{
        f"probe_{flow}_{part}": ("probe", size)
        for flow in ("alpha", "beta")
        for part, size in _PROBE.items()
    },
}

#: Kinds with one value per flight.
PER_FLIGHT: Final = ("wind", "terrain", "weather")


@dataclass(frozen=True)
class SensorParameter:
    """One unknown.

    name : as in `known_names`.
    kind : bias, scale, delay, wind, terrain, weather, arm, mount, port, probe or initial.
    subject : the channel, state or axis that it corrects.
    scope : the flight (`PER_FLIGHT`) or record (initial states) that it belongs to; empty if all
        records share it.
    size : natural size, SI.
    """

    name: str
    kind: str
    subject: str
    scope: str
    size: float

    @property
    def label(self) -> str:
        """Name with its scope, unique in one reconstruction."""
        return f"{self.name}[{self.scope}]" if self.scope else self.name


def parameter(name: str, scope: str = "") -> SensorParameter:
    """The parameter of that name; raises UnknownNameError with the nearest name otherwise.

    Its natural size is in the unit of its channel ([rad], [m/s²], ...), that of a scale [-], of a
    delay [s].

    >>> parameter("alpha_scale").kind
    'scale'
    """
    head, _, tail = name.rpartition("_")
    if name in _OWN:
        kind, size = _OWN[name]
        return SensorParameter(
            name, kind, head if kind == "delay" else tail if kind == "wind" else name, scope, size
        )
    if tail in ("bias", "scale") and head in _CHANNELS:
        return SensorParameter(name, tail, head, scope, _SIZE[head] if tail == "bias" else _SCALE)
    if tail == "delay" and head in _CHANNELS and head not in INPUTS:
        return SensorParameter(name, tail, head, scope, _DELAY)
    if name.startswith("initial_") and name[8:] in STATES:
        return SensorParameter(name, "initial", name[8:], scope, _SIZE[name[8:]])
    raise UnknownNameError(
        f"unknown reconstruction parameter '{name}'", remedy=nearest(name, known_names())
    )


def known_names() -> tuple[str, ...]:
    """Return all names that `parameter` takes: ``<channel>_bias``, ``_scale``, ``_delay`` and those
    of states."""
    sensors = [f"{channel}_{kind}" for channel in _CHANNELS for kind in ("bias", "scale")]
    delays = [f"{channel}_delay" for channel in _CHANNELS if channel not in INPUTS]
    return tuple(
        dict.fromkeys((*sensors, *delays, *_OWN, *(f"initial_{state}" for state in STATES)))
    )


def delays_of(channel: str) -> tuple[str, ...]:
    """Return the names of the parameters whose sum [s] delays a channel (`GPS_OUTPUTS` share one).

    >>> delays_of("north")
    ('north_delay', 'gps_delay')
    """
    own = f"{channel}_delay"
    return (own, "gps_delay") if channel in GPS_OUTPUTS else (own,)


def channels_of(name: str) -> tuple[str, ...]:
    """Measured channels that a sensor parameter affects; empty for parameters of a flight and
    initial states.

    Raises UnknownNameError for a name that is not in `known_names`.

    >>> channels_of("probe_beta_slope")
    ('probe_dp_beta',)
    """
    item = parameter(name)
    if name == "gps_delay" or name.startswith("gps_"):
        return GPS_OUTPUTS
    if item.kind == "port":
        return ("V", "qbar") if name.startswith("total") else ("V", "qbar", "pressure_altitude")
    if item.kind == "probe":
        return (f"probe_dp_{name.split('_')[1]}",)
    if name.startswith("air_data_"):
        return AIR_DATA
    return (item.subject,) if item.kind in ("bias", "scale", "delay") else ()


def unknowns(
    names: Sequence[str], flights: Sequence[str], records: Sequence[str]
) -> tuple[SensorParameter, ...]:
    """The parameters of a joint reconstruction: winds, terrain and weather once per flight, initial
    states once per record, all others shared.

    names : parameter names without scope. flights : one per record. records : names of the records.

    Raises UnknownNameError for a name that is not in `known_names`.
    """
    parameters: list[SensorParameter] = []
    for name in dict.fromkeys(names):
        kind = parameter(name).kind
        scopes = (
            tuple(dict.fromkeys(flights))
            if kind in PER_FLIGHT
            else tuple(records)
            if kind == "initial"
            else ("",)
        )
        parameters += [parameter(name, scope) for scope in scopes]
    return tuple(parameters)
