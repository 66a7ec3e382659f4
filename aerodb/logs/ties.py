"""Channels of a table that follow from others, and what is asked where they do not: a unit, a sign,
an axis, or the name of one of them is another."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.logs.clocks import ClockColumn, seconds_of
from aerodb.logs.guesses import Guess, in_si
from aerodb.physics import DENSITY_0, GRAVITY
from aerodb.recording import Recording
from aerodb.support import Array

#: From which correlation two columns move together.
LEAST_CORRELATION: Final = 0.9
#: Below which correlation two columns do not move together: a quarter of the variance.
_APART: Final = 0.5
#: Time over which columns are compared as means [s]: gusts and noise are shorter.
STEADY: Final = 2.0
#: Speed of sound at -60 degC, with what instruments are off [m/s].
SLOWEST_SOUND: Final = 285.0
#: Speed of sound at 50 degC, with what instruments are off [m/s].
FASTEST_SOUND: Final = 365.0
#: Factor between two columns from which units differ: no two units of a channel are nearer but
#: knots, metres and feet per second, which the speed of sound tells apart.
_ANOTHER_UNIT: Final = 2.0
#: Calibrated over true airspeed at sea level at -60 degC, with what instruments are off.
_DENSEST: Final = 1.25
#: The same at 20 km: the root of the density ratio, .27, with what instruments are off.
_THINNEST: Final = 0.2
#: Flight path from level over half of a flight that few aircraft hold [rad]: 15 deg.
_STEEP: Final = 0.26
#: Heading from the path over ground over half of a flight [rad]: 45 deg, wind as fast as 0.7 V.
_ACROSS: Final = 0.79
#: Error of a static pressure as height [m]: 36 hPa at sea level.
_PRESSED: Final = 300.0
#: Radius of the earth [m], to a third of a per cent.
_EARTH: Final = 6.371e6
#: Channel of an axis -> those of the other axes, which may be exchanged with it.
_AXES: Final = {"p": "qr", "q": "pr", "r": "pq", "ax_imu": ("ay_imu",)}


@dataclass(frozen=True)
class _Tie:
    """What a channel is by others.

    follows : time (n,) [s] and the others (n,), SI, to what the channel (n,) would be. how :
    ``slope``, compared where they move together; ``size``, the ratio of their medians while the
    others are above half of their largest; ``level``, the median of the size of the difference.
    limits : of the figure between which nothing is asked. words : what it is by the others.
    """

    channel: str
    by: tuple[str, ...]
    follows: Callable[..., Array]
    how: str
    limits: tuple[float, float]
    words: str


def _rate(time: Array, values: Array) -> Array:
    return np.gradient(values, time)


def _heading_rate(time: Array, psi: Array) -> Array:
    return np.gradient(np.unwrap(psi), time)


def _incidence(time: Array, theta: Array, velocity_down: Array, speed: Array) -> Array:
    return theta - np.arcsin(np.clip(-velocity_down / speed, -1.0, 1.0))


def _along(time: Array, theta: Array, speed: Array) -> Array:
    """Specific force along the body where lift hardly has a part in it."""
    return GRAVITY * np.sin(theta) + np.gradient(speed, time)


def _pressure_altitude(time: Array, pressure: Array) -> Array:
    """ISA below 11 km, which is within the limit up to 13 km."""
    return 44330.8 * (1.0 - (pressure / 101325.0) ** 0.190263)


_OTHER: Final = (1.0 / _ANOTHER_UNIT, _ANOTHER_UNIT)
_TIES: Final = (
    _Tie("p", ("phi",), _rate, "slope", _OTHER, "times the derivative of {}"),
    _Tie("q", ("theta",), _rate, "slope", _OTHER, "times the derivative of {}"),
    _Tie("r", ("psi",), _heading_rate, "slope", _OTHER, "times the derivative of {}"),
    *(
        _Tie(
            "velocity_down",
            (each,),
            lambda t, h: -np.gradient(h, t),
            "slope",
            _OTHER,
            "times the fall of {}",
        )
        for each in ("altitude", "pressure_altitude")
    ),
    _Tie(
        "velocity_north",
        ("latitude",),
        lambda t, north: _EARTH * np.gradient(north, t),
        "slope",
        _OTHER,
        "times the derivative of {}",
    ),
    _Tie(
        "velocity_east",
        ("longitude", "latitude"),
        lambda t, east, north: _EARTH * np.cos(north) * np.gradient(east, t),
        "slope",
        _OTHER,
        "times the derivative of {}",
    ),
    _Tie("ax_imu", ("theta", "V"), _along, "slope", _OTHER, "times that of {}"),
    _Tie(
        "alpha",
        ("theta", "velocity_down", "V"),
        _incidence,
        "slope",
        _OTHER,
        "times the pitch less the climb of {}",
    ),
    _Tie(
        "alpha",
        ("theta", "velocity_down", "V"),
        _incidence,
        "level",
        (0.0, _STEEP),
        "rad off the pitch less the climb of {}",
    ),
    _Tie(
        "psi",
        ("velocity_north", "velocity_east"),
        lambda t, north, east: np.arctan2(east, north),
        "level",
        (0.0, _ACROSS),
        "rad off the path by {}",
    ),
    _Tie(
        "V",
        ("mach",),
        lambda t, mach: mach,
        "size",
        (SLOWEST_SOUND, FASTEST_SOUND),
        "m/s for each of {}, which is no speed of sound",
    ),
    _Tie("calibrated_airspeed", ("V",), lambda t, v: v, "size", (_THINNEST, _DENSEST), "times {}"),
    _Tie(
        "qbar",
        ("calibrated_airspeed",),
        lambda t, v: 0.5 * DENSITY_0 * v**2,
        "size",
        _OTHER,
        "times that of {}",
    ),
    _Tie(
        "qbar", ("rho", "V"), lambda t, rho, v: 0.5 * rho * v**2, "size", _OTHER, "times that of {}"
    ),
    _Tie(
        "pressure_altitude",
        ("static_pressure",),
        _pressure_altitude,
        "level",
        (0.0, _PRESSED),
        "m off the height of {}",
    ),
)


def untied(
    recording: Recording,
    guesses: Mapping[str, Guess],
    clocks: Mapping[str, ClockColumn],
    columns: Mapping[tuple[str, str], Array],
) -> Iterator[Guess]:
    """Guesses that contradict each other, with the question that this asks: of those whose unit is
    assumed, else of all.

    columns : (topic, column) -> (n,), as logged.
    """
    for tie in _TIES:
        series = _series(recording, guesses, (tie.channel, *tie.by), clocks, columns)
        if series is None:
            continue
        time, shown, *by = series
        with np.errstate(all="ignore"):
            follows = tie.follows(time, *by)
            figure = _figure(tie, time, shown, follows, by)
        told = (tie.channel, *tie.by)
        if figure is not None and not tie.limits[0] <= figure <= tie.limits[1]:
            names = " and ".join(guesses[each].field for each in tie.by)
            ask = (
                f"{guesses[tie.channel].field} is {figure:.3g} {tie.words.format(names)}:"
                " is the unit, the sign or the name of one of them another?"
            )
        elif figure is None and (
            other := _exchanged(tie, series, recording, guesses, clocks, columns)
        ):
            told = (tie.channel, other)
            ask = (
                f"{guesses[other].field} follows {guesses[tie.by[0]].field}, and"
                f" {guesses[tie.channel].field} does not: are two axes exchanged?"
            )
        else:
            continue
        doubted = [guesses[each] for each in told if guesses[each].assumed]
        for each in doubted or [guesses[each] for each in told]:
            if not each.open:
                yield replace(each, open=ask)


def _series(
    recording: Recording,
    guesses: Mapping[str, Guess],
    names: tuple[str, ...],
    clocks: Mapping[str, ClockColumn],
    columns: Mapping[tuple[str, str], Array],
) -> list[Array] | None:
    """Time [s] and channels (n,), SI, where all are finite; None where they cannot be compared."""
    known = [guesses[each] for each in names if each in guesses and guesses[each].unit]
    if len(known) < len(names) or len({each.topic for each in known}) > 1:
        return None
    every = [seconds_of(recording, known[0].topic, clocks)]
    every += [in_si(each, columns) for each in known]
    if len({each.size for each in every}) > 1:
        return None
    good = np.all(np.isfinite(every), axis=0)
    if good.sum() < 20 or np.any(np.diff(every[0][good]) <= 0):
        return None
    return [each[good] for each in every]


def _figure(tie: _Tie, time: Array, shown: Array, follows: Array, by: list[Array]) -> float | None:
    """The figure of a tie; None where the columns do not tell it."""
    if tie.how == "slope":
        return slope(time, follows, shown)
    if tie.how == "level":
        off = shown - follows
        if tie.channel == "psi":
            off = (off + np.pi) % (2.0 * np.pi) - np.pi
        return float(np.median(np.abs(off)))
    most = float(np.max(follows))
    if most <= 0.0:
        return None
    moving = follows > 0.5 * most
    return float(np.median(shown[moving]) / np.median(follows[moving]))


def _exchanged(
    tie: _Tie,
    series: list[Array],
    recording: Recording,
    guesses: Mapping[str, Guess],
    clocks: Mapping[str, ClockColumn],
    columns: Mapping[tuple[str, str], Array],
) -> str:
    """The other axis that a tie fits, where it does not fit its own; '' for none."""
    time, shown, *by = series
    if abs(together(time, shown, tie.follows(time, *by)) or 0.0) > _APART:
        return ""
    for other in _AXES.get(tie.channel, ()):
        others = _series(recording, guesses, (other, *tie.by), clocks, columns)
        if others is None:
            continue
        if slope(others[0], tie.follows(others[0], *others[2:]), others[1]) is not None:
            return other
    return ""


def slope(time: Array, one: Array, other: Array) -> float | None:
    """Slope of a column (n,) over another one at their samples, else as means over `STEADY`; None
    where they do not move together."""
    for width in (1, _width(time)):
        means = _means(width, one, other)
        if means is None or any(np.ptp(each) == 0.0 for each in means):
            continue
        if abs(np.corrcoef(means[0], means[1])[0, 1]) >= LEAST_CORRELATION:
            one_, other_ = (each - np.mean(each) for each in means)
            return float(np.dot(other_, one_) / np.dot(one_, one_))
    return None


def together(time: Array, one: Array, other: Array) -> float | None:
    """Correlation of means over `STEADY` of two columns (n,); None where too little is there."""
    good = np.isfinite(time) & np.isfinite(one) & np.isfinite(other)
    if good.sum() < 2:
        return None
    means = _means(_width(time[good]), one[good], other[good])
    if means is None:
        return None
    with np.errstate(all="ignore"):
        return float(np.corrcoef(means[0], means[1])[0, 1])


def _width(time: Array) -> int:
    """Samples of `STEADY`."""
    return max(1, round(STEADY / max(float(np.median(np.diff(time))), 1e-6)))


def _means(width: int, *columns: Array) -> list[Array] | None:
    """Means of columns (n,) over samples; None for columns that are too short for it."""
    if columns[0].size < 10 * width:
        return None
    from scipy.ndimage import uniform_filter1d  # here: a mapping that is read needs none

    return [uniform_filter1d(each, width) for each in columns]
