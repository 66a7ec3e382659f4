"""Flow angles and attitude against the motion.

What an aircraft turns and climbs is known from gyros and accelerometers: their angles, integrated
in steady air, change as those of vanes and of the attitude do (Stevens, Lewis & Johnson, Aircraft
Control and Simulation, 3rd ed., section 2.5). A sensor that is late or filtered by T misses T times
its own signal of the integral. A vane ahead of the CG shows a part of the rates. A vane whose
upwash is not corrected, or divided by instead of multiplied, changes more. A gyro that is reversed
or scaled for a part of the flight turns the attitude by another factor there. Gusts move the vane
alone, and the aircraft yields to them: less is explained, the vane changes less than the motion,
and accelerometers seem early. Of that nothing is said. A vane that is late, or behind a filter,
shows what the motion made it a while ago, which no gust does.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import (
    BAND,
    KINEMATICS,
    LEAST_EXPLAINED,
    OPTIONAL,
    SAMPLES_PER_PERIOD,
    SCALE_TOLERANCE,
    SETTLED,
    Suspicion,
    with_accelerations,
)
from aerodb.errors import InputError
from aerodb.estimation import Regression, least_squares, samples_per_independent
from aerodb.flight import Flight
from aerodb.signals import band_passed, bridge, first_order_lag, integrated
from aerodb.support import HALF, NOTABLE, Array, half_interval
from aerodb.suspicions.begin import SIDE, explained_from
from aerodb.suspicions.changing import CHANGED
from aerodb.suspicions.equation_error import averaged
from aerodb.suspicions.evidence import ERRORS, LATE, LIKELIER, SWING, WELL_EXPLAINED, likelier_by
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
#: Delays of a vane that are tried [s]: from twice `LATE` to half a period of the slowest swing that
#: most aircraft have, beyond which a delay looks like another sign.
_DELAYS: Final = (0.3, 0.4, 0.6, 0.8, 1.0)
#: Time constants of a vane's filter that are tried [s]: from that of twice `LATE` to where it
#: integrates all of the band.
_FILTERS: Final = (0.4, 0.7, 1.0, 1.5, 2.0, 3.0)
#: Share of what the motion leaves of a vane that a delay must explain: upwash, gusts and noise
#: hold the rest.
EXPLAINED: Final = HALF
#: Least change of a gyro's gain that is said: a scale error is a few hundredths, and is constant.
LEAST_GAIN: Final = NOTABLE


@dataclass(frozen=True, eq=False)
class _Angle:
    """An angle as logged, as the motion turns it, the rates of its vane's place and the signal of
    its sensor, all band-passed, (n,) [rad], with the times [s]; a delay of the sensor [s] adds as
    much of its signal.

    positive : where the sensor shows more than zero. turned_by : shares (n,) of the rate -> the
    angle as these turn it."""

    name: str
    sensor: str
    time: Array
    shown: Array
    turned: Array
    place: tuple[Array, ...]
    signal: Array
    positive: NDArray[np.bool_]
    turned_by: Callable[[Array], Array]

    @property
    def in_air(self) -> bool:
        """Whether it is an angle of flow, of a vane somewhere, which gusts move."""
        return bool(self.place)

    def fit(self, *more: Array) -> Regression | None:
        """The logged angle by the motion and further columns (n,); None where they do not explain
        it or where nothing moves."""
        found = self.by(self.turned, *more)
        return found if found is not None and found.r_squared > WELL_EXPLAINED else None

    def by(self, *columns: Array) -> Regression | None:
        """The logged angle by columns (n,), however much they explain of it; None where they are
        not told apart or nothing moves."""
        if not np.std(self.turned) > SWING:
            return None
        try:
            names = tuple(str(k) for k in range(len(columns)))
            return least_squares(np.column_stack(columns), self.shown, names)
        except (ValueError, InputError):
            return None

    def left(self, columns: tuple[Array, ...]) -> float:
        """The squares that columns (n,) leave of the logged angle [rad^2]."""
        basis = np.linalg.qr(np.column_stack(columns))[0]
        rest = self.shown - basis @ (basis.T @ self.shown)
        return float(rest @ rest)


def angle_suspicions(flight: Flight) -> tuple[Suspicion, ...]:
    """Return gyros that are late, or else accelerometers, or else gyros whose gain changes, or else
    an angle of attack that changes more than the motion makes it, or else vanes that are late.

    flight : with the upwash that the vehicle file declares taken off.

    Angles (n,) [rad], band in Hz. Source: `docs/method/consistency.md`, section "Against the
    vehicle".
    """
    channels = with_accelerations(flight)
    if not channels:
        return ()
    angles = [each for name in _SHOWN if (each := _angle(name, flight, channels)) is not None]
    for in_air in (False, True):
        late = [said for each in angles if each.in_air == in_air for said in _late(each)]
        if late:
            return tuple(late)
    changed = [said for each in angles if not each.in_air for said in _changed(each)]
    if changed:
        return tuple(changed)
    larger = [said for each in angles if each.name == "alpha" for said in _larger(each)]
    if larger:  # rates turn sideslip by alpha: with a wrong one beta seems late
        return tuple(larger)
    return tuple(said for each in angles if each.in_air for said in _behind(each))


@dataclass(frozen=True, eq=False)
class _Motion:
    """An angle and the rate that turns it, in the band of motion: means of `every` samples where
    the aircraft flies and everything needed is usable, (m,).

    stretch : from the first such sample to the last, begun at a multiple of `every`: a rate that is
    held over a roll would turn the angle on and on."""

    name: str
    channels: Mapping[str, Array]
    flown: NDArray[np.bool_]
    stretch: slice
    step: float
    every: int

    def moving(self, values: Array) -> Array:
        """Values (n,) there, band-passed (m,); ValueError or InputError where they cannot be."""
        return self._in_band(self.mean(values))

    @property
    def shown(self) -> Array:
        """The angle as logged, (m,) [rad]."""
        values = self.channels[self.name]
        return self.moving(values if self.name != "psi" else np.unwrap(values))

    @property
    def turned(self) -> Array:
        """The angle as the motion turns it, (m,) [rad]."""
        return self.turned_by(1.0)

    def turned_by(self, shares: Array | float) -> Array:
        """The angle as shares (m,) of its rate turn it, (m,) [rad]."""
        rate = bridge(self.mean(self._rate))
        return self._in_band(integrated(shares * rate, self.step))

    @property
    def known(self) -> NDArray[np.bool_]:
        """Where the angle and its rate are known, (m,)."""
        return np.isfinite(self.mean(self._rate + self.channels[self.name]))

    @property
    def _rate(self) -> Array:
        return KINEMATICS[self.name][0](self.channels)

    def mean(self, values: Array) -> Array:
        """Values (n,) there, as they are (m,)."""
        return averaged(np.where(self.flown, values, np.nan)[self.stretch], self.every)

    def _in_band(self, values: Array) -> Array:
        return band_passed(bridge(values), self.step, BAND[0], _highest(self.step))


def _highest(step: float) -> float:
    """Highest frequency [Hz] at which an angle is compared."""
    return min(BAND[1], 0.4 / step)


def _motion(
    name: str, flight: Flight, channels: Mapping[str, Array], every: int, *more: str
) -> _Motion | None:
    """An angle and its rate, the means of `every` samples; None where something is missing, more
    channels among it, or where too little is flown."""
    needed, step = KINEMATICS[name][1], every * flight.step
    if not {*needed, *more} <= channels.keys() or _highest(step) < 2.0 * BAND[0]:
        return None
    where = flying(flight, [n for n in (*needed, "ax_imu", "ay_imu", "az_imu") if n in flight])
    if "V" in needed:
        where &= channels["V"] > 0.0
    if where.sum() < max(20 * every, SETTLED / flight.step):
        return None
    flown = np.flatnonzero(where)
    stretch = slice(int(flown[0] // every * every), int(flown[-1]) + 1)
    return _Motion(name, channels, where, stretch, step, every)


def _angle(name: str, flight: Flight, channels: Mapping[str, Array]) -> _Angle | None:
    place, sensor = _SHOWN[name]
    every = max(1, int(1.0 / (SAMPLES_PER_PERIOD * BAND[1] * flight.step)))
    made = _motion(name, flight, channels, every, *place)
    if made is None:
        return None
    inside, speed = made.known, channels["V"] if place else 1.0  # a / V is what turns the flow
    try:
        return _Angle(
            name,
            sensor if sensor in flight else f"{sensor}_imu",
            averaged(flight.time[made.stretch], every)[inside],
            made.shown[inside],
            made.turned[inside],
            tuple(made.moving(channels[each])[inside] for each in place),
            made.moving(channels[sensor] / speed)[inside],
            made.mean(channels[sensor])[inside] > 0.0,
            lambda shares: made.turned_by(
                np.interp(np.arange(len(inside)), np.flatnonzero(inside), shares)
            )[inside],
        )
    except (ValueError, InputError):
        return None


def off_motion(flight: Flight, every: int) -> dict[str, Array]:
    """Return how far the vanes' angles are from those that the motion makes, in the band of
    motion: angle -> (m,) [rad], each the mean of `every` samples.

    Gusts are in it, and all that is wrong with the vane or its channel; no constant is.
    """
    channels, found = with_accelerations(flight), {}
    size = len(averaged(flight.time, every))
    for name in ("alpha", "beta"):
        made = _motion(name, flight, channels, every) if name in flight else None
        if made is not None and made.known.any():
            with contextlib.suppress(ValueError, InputError):
                off = np.where(made.known, made.shown - made.turned, 0.0)
                before = made.stretch.start // every
                found[name] = np.pad(off, (before, max(0, size - before - len(off))))[:size]
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


def _changed(angle: _Angle) -> Iterator[Suspicion]:
    """The gyro that turns an attitude by another factor from one time on, ever more, or to one
    side; the claim pays for what is tried."""
    one = angle.by(angle.turned)
    if one is None:
        return
    rate, shown = (np.gradient(values) for values in (angle.turned, angle.shown))
    basis = rate[:, None] / max(float(np.linalg.norm(rate)), 1e-300)
    left = shown - basis @ (basis.T @ shown)
    if left @ left < LEAST_GAIN**2 * SIDE * (1.0 - SIDE) * float(shown @ shown):
        return  # a change that is said leaves more than that
    at = int(np.argmax(explained_from(rate, basis, left)))
    sample = np.arange(len(rate))
    begin = float(angle.time[at])
    tried = {
        f"from about {begin:.1f} s on": sample >= at,
        "at the end": sample / len(rate),
        f"where {angle.sensor} is positive": angle.positive,
    }
    made = {where: angle.turned_by(shares.astype(float)) for where, shares in tried.items()}
    where = min(made, key=lambda each: angle.left((angle.turned, made[each])))
    fit = angle.by(angle.turned, made[where])
    if fit is None or fit.r_squared < LEAST_EXPLAINED:
        return
    more = (1.0 - one.r_squared) / max(1.0 - fit.r_squared, 1e-12)
    before, change = (float(each) for each in fit.estimates)
    error = float(fit.standard_errors[1])
    if (
        1.0 - 1.0 / more < EXPLAINED
        or likelier_by(fit, more) < LIKELIER + np.log(len(rate) + len(tried))
        or abs(change) < LEAST_GAIN + ERRORS * error
    ):
        return
    also = (*KINEMATICS[angle.name][1], *OPTIONAL.get(angle.name, ()))
    others = " or ".join(n for n in also if n not in (angle.sensor, angle.name))
    words = (
        f"rates turn {angle.name} by {before:.3g} of what it shows, and by"
        f" {before + change:.3g} +- {half_interval(error):.1g} {where}: sign or scale of"
        f" {angle.sensor} or {angle.name} changes, or {others} is wrong"
    )
    evidence = {"before": before, "ratio": before + change, "standard_error": error}
    yield Suspicion(angle.sensor, CHANGED, words, evidence)


def _behind(angle: _Angle) -> Iterator[Suspicion]:
    """A vane that shows what the motion made it a while ago, all the time or from one time on; the
    claim pays for what is tried."""
    made = (angle.turned, *angle.place)
    step = float(np.median(np.diff(angle.time)))
    right = angle.by(*made)
    if right is None:
        return
    kinds: dict[str, tuple[Callable[[Array, float, float], Array], tuple[float, ...]]] = {
        "late by about": (_delayed, _DELAYS),
        "behind a filter of about": (first_order_lag, _FILTERS),
    }
    tried = {
        (how, seconds): tuple(change(values, step, seconds) for values in made)
        for how, (change, sizes) in kinds.items()
        for seconds in sizes
    }

    found = min(tried, key=lambda each: angle.left(tried[each]))
    told = _told(angle, right, tried[found], len(tried))
    if told is not None:
        yield _is_behind(angle, "", *found, told)
        return
    basis = np.linalg.qr(np.column_stack(made))[0]
    rest = angle.shown - basis @ (basis.T @ angle.shown)
    begun = {
        each: explained_from(columns[0] - made[0], basis, rest) for each, columns in tried.items()
    }
    found = max(begun, key=lambda each: float(begun[each].max()))
    at = int(np.argmax(begun[found]))
    since = np.arange(len(rest)) >= at
    columns = tuple(np.where(since, *both) for both in zip(tried[found], made, strict=True))
    told = _told(angle, right, columns, len(tried) * len(rest))  # each sample is tried
    if told is not None:
        begin = float(angle.time[at])
        yield _is_behind(angle, f"from {begin:.1f} s on ", *found, {**told, "from": begin})


def _told(
    angle: _Angle, right: Regression, columns: tuple[Array, ...], tried: int
) -> dict[str, float] | None:
    """How likely columns that are late explain an angle better than `right` does, and what of its
    squares; None where they do not, by `EXPLAINED` and as the best of so many that are tried."""
    fit = angle.by(*columns)
    if fit is None or fit.r_squared < WELL_EXPLAINED or not fit.estimates[0] > 0.0:
        return None
    more = (1.0 - right.r_squared) / max(1.0 - fit.r_squared, 1e-12)
    likelier, explained = likelier_by(fit, more), 1.0 - 1.0 / more
    claimed = explained >= EXPLAINED and likelier >= LIKELIER + np.log(tried)
    return {"likelier": likelier, "explained": explained} if claimed else None


def _is_behind(
    angle: _Angle, when: str, how: str, seconds: float, found: dict[str, float]
) -> Suspicion:
    words = (
        f"{when}{angle.name} is {how} {seconds:.2g} s: rates and accelerations make it change"
        f" before it does. That explains {found['explained']:.0%} of what they leave of it. A"
        f" filter or the clock of {angle.name}, or rates and accelerations are early"
    )
    return Suspicion(angle.name, "late", words, {"delay": seconds, **found})


def _delayed(values: Array, step: float, seconds: float) -> Array:
    """Values (n,) so much later [s], the first one until then."""
    late = round(seconds / step)
    return np.concatenate([np.full(late, values[0]), values[: len(values) - late]])


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
