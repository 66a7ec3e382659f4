"""Flow angles and attitude against the motion.

What an aircraft turns and climbs is known from gyros and accelerometers: their angles, integrated
in steady air, change as those of vanes and of the attitude do (Stevens, Lewis & Johnson, Aircraft
Control and Simulation, 3rd ed., section 2.5). A sensor that is late or filtered by T misses T times
its own signal of the integral. A vane ahead of the CG shows a part of the rates. A vane whose
upwash is not corrected, or divided by instead of multiplied, changes more. Gusts move the vane
alone, and the aircraft yields to them: less is explained, the vane changes less than the motion,
and accelerometers seem early. Of that nothing is said.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.conditioning import (
    BAND,
    KINEMATICS,
    LEAST_EXPLAINED,
    SAMPLES_PER_PERIOD,
    SCALE_TOLERANCE,
    SETTLED,
    Suspicion,
    with_accelerations,
)
from aerodb.errors import InputError
from aerodb.estimation import Regression, least_squares, samples_per_independent
from aerodb.flight import Flight
from aerodb.signals import band_passed, bridge
from aerodb.support import Array, half_interval
from aerodb.suspicions.begin import explained_from
from aerodb.suspicions.equation_error import averaged
from aerodb.suspicions.evidence import ERRORS, LATE, LIKELIER, SWING, WELL_EXPLAINED
from aerodb.suspicions.in_flight import flying

#: Angle -> the rates of which the place of its vane adds a part, and the sensor whose delay the
#: angle shows: attitude first, from which the rates of flow angles follow.
_SHOWN: Final = {
    "theta": ((), "q"),
    "phi": ((), "p"),
    "psi": ((), "r"),
    "alpha": (("q",), "az"),
    "beta": (("r", "p"), "ay"),
}


@dataclass(frozen=True, eq=False)
class _Angle:
    """An angle as logged, as the motion turns it, the rates of its vane's place and the signal of
    its sensor, all band-passed, (n,) [rad], with the times [s]; a delay of the sensor [s] adds as
    much of its signal."""

    name: str
    sensor: str
    time: Array
    shown: Array
    turned: Array
    place: tuple[Array, ...]
    signal: Array

    @property
    def in_air(self) -> bool:
        """Whether it is an angle of flow, of a vane somewhere, which gusts move."""
        return bool(self.place)

    def fit(self, *more: Array) -> Regression | None:
        """The logged angle by the motion and further columns (n,); None where they do not explain
        it or where nothing moves."""
        columns = np.column_stack([self.turned, *more])
        try:
            found = least_squares(columns, self.shown, tuple(str(k) for k in range(len(columns.T))))
        except (ValueError, InputError):
            return None
        told = found.r_squared > WELL_EXPLAINED and np.std(self.turned) > SWING
        return found if told else None


def angle_suspicions(flight: Flight) -> tuple[Suspicion, ...]:
    """Return gyros that are late, or else accelerometers, or else an angle of attack that changes
    more than the motion makes it change.

    flight : with the upwash that the vehicle file declares taken off.

    Angles (n,) [rad], band in Hz. Source: `docs/method/consistency.md`, section "Against the
    vehicle".
    """
    channels = with_accelerations(flight)
    angles = [each for name in _SHOWN if (each := _angle(name, flight, channels)) is not None]
    for in_air in (False, True):
        late = [said for each in angles if each.in_air == in_air for said in _late(each)]
        if late:
            return tuple(late)
    return tuple(said for each in angles if each.name == "alpha" for said in _larger(each))


def _angle(name: str, flight: Flight, channels: dict[str, Array]) -> _Angle | None:
    rate, needed = KINEMATICS[name]
    place, sensor = _SHOWN[name]
    if not {*needed, *place} <= channels.keys():
        return None
    logged = [n for n in (*needed, "ax_imu", "ay_imu", "az_imu") if n in flight]
    where = flying(flight, logged)
    if "V" in needed:
        where &= channels["V"] > 0.0
    every = max(1, int(1.0 / (SAMPLES_PER_PERIOD * BAND[1] * flight.step)))
    step, high = every * flight.step, min(BAND[1], 0.4 / flight.step)
    if where.sum() * flight.step < SETTLED or high < 2.0 * BAND[0] or len(where) < 20 * every:
        return None

    def thin(values: Array) -> Array:
        return averaged(np.where(where, values, np.nan), every)

    inside = np.isfinite(thin(channels[name]))

    def moving(values: Array) -> Array:
        return band_passed(bridge(values), step, BAND[0], high)[inside]

    try:
        turning = bridge(thin(rate(channels)))
        turned = np.concatenate([[0.0], np.cumsum(0.5 * step * (turning[1:] + turning[:-1]))])
        speed = channels["V"] if place else 1.0  # an accelerometer turns the flow by a / V
        shown = channels[name] if name != "psi" else np.unwrap(channels[name])
        return _Angle(
            name,
            sensor if sensor in flight else f"{sensor}_imu",
            averaged(flight.time, every)[inside],
            moving(thin(shown)),
            moving(turned),
            tuple(moving(thin(channels[each])) for each in place),
            moving(thin(channels[sensor] / speed)),
        )
    except (ValueError, InputError):
        return None


def off_motion(flight: Flight, every: int) -> dict[str, Array]:
    """Return how far the vanes' angles are from those that the motion makes, in the band of
    motion: angle -> (m,) [rad], each the mean of `every` samples.

    Gusts are in it, and all that is wrong with the vane or its channel; no constant is.
    """
    channels, found = with_accelerations(flight), {}
    step = every * flight.step
    high = min(BAND[1], 0.4 / step)
    for name in ("alpha", "beta"):
        rate, needed = KINEMATICS[name]
        if not set(needed) <= channels.keys() or name not in flight or high < 2.0 * BAND[0]:
            continue
        where = flying(flight, [n for n in needed if n in flight]) & (channels["V"] > 0.0)
        turning, shown = (
            averaged(np.where(where, values, np.nan), every)
            for values in (rate(channels), channels[name])
        )
        known = np.isfinite(turning + shown)
        if known.sum() < max(20, SETTLED / step):
            continue
        turning = bridge(turning)
        turned = np.concatenate([[0.0], np.cumsum(0.5 * step * (turning[1:] + turning[:-1]))])
        try:
            apart = band_passed(bridge(shown) - turned, step, BAND[0], high)
        except (ValueError, InputError):
            continue
        found[name] = np.where(known, apart, 0.0)
    return found


def _late(angle: _Angle) -> Iterator[Suspicion]:
    """The sensor that is late behind the angle that it turns: all the time, or, of attitude, which
    no gust moves, from one time on."""
    whole = _delay(angle, angle.signal)
    if whole is not None:
        yield _is_late(angle, "", whole)
        return
    if angle.in_air or angle.fit() is None:
        return
    basis, _ = np.linalg.qr(np.column_stack([angle.turned, angle.signal]))
    left = angle.shown - basis @ (basis.T @ angle.shown)
    explained = explained_from(angle.signal, basis, left)
    at = int(np.argmax(explained))
    rest = max(1.0 - float(explained[at]) / max(float(left @ left), 1e-300), 1e-12)
    independent = len(left) / samples_per_independent(left)
    if -0.5 * independent * np.log(rest) < LIKELIER + np.log(len(left)):  # each sample is tried
        return
    since = _delay(angle, angle.signal * (np.arange(len(left)) >= at), angle.signal)
    if since is not None:
        begin = float(angle.time[at])
        yield _is_late(angle, f"from {begin:.1f} s on ", {**since, "from": begin})


def _delay(angle: _Angle, signal: Array, *beside: Array) -> dict[str, float] | None:
    """Delay and standard error [s] of a signal (n,) that is late; None where it is not."""
    fit = angle.fit(*angle.place, *beside, signal)
    if fit is None:
        return None
    # Gusts move the vane, and the accelerometers with it; attitude follows its rates closely.
    if angle.in_air and abs(fit.estimates[0] - 1.0) > SCALE_TOLERANCE:
        return None
    if not angle.in_air and fit.r_squared < LEAST_EXPLAINED:
        return None
    late, error = float(fit.estimates[-1]), float(fit.standard_errors[-1])
    told = late > LATE + ERRORS * error
    return {"delay": late, "standard_error": error} if told else None


def _is_late(angle: _Angle, when: str, found: dict[str, float]) -> Suspicion:
    half = half_interval(found["standard_error"])
    words = (
        f"{when}{angle.sensor} is {found['delay']:.2g} +- {half:.1g} s late: {angle.name}"
        f" changes before {angle.sensor} makes it. A filter or the clock of {angle.sensor}, or"
        f" {angle.name} is early"
    )
    return Suspicion(angle.sensor, "delay", words, found)


def _larger(angle: _Angle) -> Iterator[Suspicion]:
    """The angle of attack where it changes more than the motion makes it change."""
    fit = angle.fit()
    if fit is None:
        return
    ratio, error = float(fit.estimates[0]), float(fit.standard_errors[0])
    if ratio - 1.0 > SCALE_TOLERANCE + ERRORS * error:
        words = (
            f"alpha changes by {ratio:.3g} +- {half_interval(error):.2g} times what rates and"
            " accelerations make it change. [air_data] upwash of the vehicle file is missing or"
            " inverted, or the vane's scale is another, or that of q"
        )
        yield Suspicion("alpha", "size", words, {"ratio": ratio, "standard_error": error})
