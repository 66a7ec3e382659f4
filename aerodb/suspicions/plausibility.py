"""Plausibility of a record before anything is estimated from it: likely faults and their causes.

The evidence: topics that do not overlap in time, sensors that do not change, accelerations that do
not balance the weight, and channels that disagree with their kinematics (`hypotheses`). Errors of a
few percent, biases and delays raise no suspicion: flight-path reconstruction estimates them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri

from aerodb.conditioning import (
    BAND,
    KINEMATICS,
    RAREST,
    SAMPLES_PER_PERIOD,
    SHORTEST_STUCK,
    Suspicion,
    airspeed_rate,
    spikes,
    stuck,
    with_accelerations,
)
from aerodb.estimation import samples_per_independent
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS, MOST_SHARE, SHARES, is_surface
from aerodb.physics import GRAVITY
from aerodb.signals import decimated, low_passed
from aerodb.support import CLAIM, HALF, NEGLIGIBLE, NOTABLE, Array
from aerodb.suspicions.drag import ACCELERATION
from aerodb.suspicions.equation_error import averaged
from aerodb.suspicions.evidence import ERRORS, FEWEST, LARGEST_ANGLE, STILL, SWING, WELL_EXPLAINED
from aerodb.suspicions.hypotheses import explain
from aerodb.suspicions.over_ground import over_ground_suspicions

_ACCELERATIONS = ("ax", "ay", "az", "ax_imu", "ay_imu", "az_imu")
#: Sensors whose output must change when the aircraft moves.
_SENSORS = ("p", "q", "r", *_ACCELERATIONS, "alpha", "beta", "phi", "theta")
#: Of these, angles: rates are about their slopes.
_ANGLES = ("alpha", "beta", "phi", "theta")
#: Largest share of spikes that is looked for; more is noise.
OFTEN = NOTABLE
#: Largest median deviation of a load factor from its median. A channel near 1 that varies more is
#: no load factor but an acceleration without gravity.
LOAD_SPREAD = 0.7
#: Largest plausible distance of a centre of gravity from its datum [m], which may lie ahead of the
#: longest aircraft (84 m).
FARTHEST = 100.0
#: The same in spans, where the vehicle is known: slender aircraft are three spans long.
FARTHEST_SPANS = 5.0
#: Channels of one kind and size, the more often mistaken one first.
_ALIKE = (("alpha", "beta", "theta", "phi", "psi"), ("p", "q", "r"), ("ax", "ay", "az"))
#: Share of the motion by which two sensors of one flight differ at least: noise alone is more.
SAME = NEGLIGIBLE
#: Least ratio of their sizes for one field mapped to both, with an upwash taken off one of them.
ONE_FIELD = HALF
#: Share of samples that may lie beyond 0 to 1: single samples are wrong.
SELDOM = NEGLIGIBLE
#: A start later than the moment of reading by no more than this can be local time taken for UTC.
_AHEAD = timedelta(days=1)
_CG = ("cg_x", "cg_y", "cg_z")


def suspicions(
    flight: Flight, span: float | None = None, chord: float | None = None
) -> tuple[Suspicion, ...]:
    """Return the likely faults of wiring, sign, unit or declaration; empty for a good record.

    span, chord : of the vehicle [m]; None: not known. Channels are (n,), in SI units; flags are
    `FLAGS`.

    The checks:

    - a centre of gravity that no aircraft of this size can have, or that travels by a chord;

    - channels without a usable sample at the times of the rates;
    - sensors that do not change while others do;
    - channels with more spikes than a few;
    - a position or command from 0 to 1 that reaches more;
    - an angle, a rate or an acceleration with the history of another;
    - missing gravity, wrong sign or wrong unit of the vertical acceleration;
    - a rate, attitude, flow angle or acceleration of wrong sign, degrees declared as radians or the
      reverse, exchanged axes. Of several such faults one is named: correct it and run again;

    - an airspeed that turns over ground contradict, by its scale.

    Samples flagged as stuck or implausible are included: they are the evidence. A record without
    motion shows few faults.
    """
    hidden = np.uint8(FLAGS["stuck"] | FLAGS["implausible"])
    flight = replace(flight, flags={name: bits & ~hidden for name, bits in flight.flags.items()})
    listed = [
        *_without_samples(flight),
        *_standing_still(flight),
        *_often_wild(flight),
        *_too_large(flight),
        *_no_share(flight),
        *_impossible_cg(flight, span, chord),
    ]
    unusable = {suspicion.channel for suspicion in listed}
    channels = {
        name: values for name, values in with_accelerations(flight).items() if name not in unusable
    }
    vertical, channels = _weight(channels)
    listed += vertical
    copies = _copies(channels)
    listed += copies
    if len(flight.time) >= 32 and channels and not copies:
        thin, step = decimated(channels, flight.step, SAMPLES_PER_PERIOD * BAND[1])
        listed += _kinematic(thin, step) or _aerodynamic(thin, step)
    if "V" not in {suspicion.channel for suspicion in listed}:
        listed += over_ground_suspicions(flight)
    return tuple(listed)


def start_suspicions(start: datetime | None, read: datetime) -> tuple[Suspicion, ...]:
    """Return what is wrong with the start of a log that was read at a time (both with time zone):
    a start more than a day later, which no time zone explains."""
    if start is None or start - read <= _AHEAD:
        return ()
    days = (start - read) / timedelta(days=1)
    sentence = (
        f"the log says that it starts at {start.astimezone(UTC):%Y-%m-%d %H:%M} UTC,"
        f" {days:.3g} days after it was read: its clock was set wrong. Its date is not known, times"
        " within the flight are"
    )
    return (Suspicion("start_utc", "future", sentence, {"days": days}),)


def _without_samples(flight: Flight) -> list[Suspicion]:
    """Return channels without a usable sample at the times of the rates and accelerations."""
    core = [name for name in ("p", "q", "r", *_ACCELERATIONS) if name in flight]
    reference = (
        np.any([flight.usable([name]) for name in core], axis=0) if core else flight.usable()
    )
    suspicions = []
    for name in flight.channels:
        if reference.any() and not (flight.usable([name]) & reference).any():
            sentence = (
                f"{name} has no usable sample at the times of rates and accelerations: their topics"
                " do not overlap in time"
            )
            suspicions.append(
                Suspicion(
                    name, "no_overlap", sentence, {"usable": float(flight.usable([name]).sum())}
                )
            )
    return suspicions


def _standing_still(flight: Flight) -> list[Suspicion]:
    """Return sensors that never change, or hold one value for long, while two others move."""
    present = {name: flight[name][flight.usable([name])] for name in _SENSORS if name in flight}
    present = {name: values for name, values in present.items() if len(values) > 1}
    moving = [name for name, values in present.items() if float(np.std(values)) > STILL]
    suspicions = []
    for name, values in present.items():
        others = [other for other in moving if other != name]
        own = np.where(flight.usable([name]), flight[name], np.nan)
        held, constant = stuck(own, flight.step), float(np.ptp(values)) == 0.0
        longer = stuck(own, flight.step, jump=False)
        if (longer & ~held).any() and _is_missed(flight, name, list(present), longer):
            held = longer
        if held.any() and not constant:  # keep those that moved meanwhile
            others = [
                other
                for other in others
                if float(np.std(flight[other][held])) > 0.3 * float(np.std(present[other]))
            ]
        share = 1.0 if constant else float(np.mean(held))
        if share > RAREST and len(others) >= 2:
            since = float(flight.time[np.argmax(held)]) if held.any() else float(flight.time[0])
            what = "never changes" if constant else f"does not change from {since:.6g} s on"
            words = (
                f"{name} {what} while {others[0]} and {others[1]} do: its sensor is stuck or was"
                " not recorded"
            )
            suspicions.append(
                Suspicion(
                    name,
                    "stuck",
                    words,
                    {"share": share, "from": since, "value": float(values[-1])},
                )
            )
    return suspicions


def _is_missed(flight: Flight, name: str, sensors: Sequence[str], held: NDArray[np.bool_]) -> bool:
    """Whether a coarse channel should have changed where it holds a value: there the others, by
    what they tell of it elsewhere, miss it more than elsewhere (F test at the rate of a claim)."""
    every = max(1, round(SHORTEST_STUCK / flight.step))
    means = {each: averaged(flight[each], every) for each in sensors}
    turning = [np.gradient(means[each]) for each in _ANGLES if each in means]
    others = [values for each, values in means.items() if each != name]
    columns = np.column_stack([np.ones(len(means[name])), *others, *turning])
    usable = np.isfinite(columns).all(axis=1) & np.isfinite(means[name])
    inside = averaged(held.astype(float), every) > 0.5
    here, elsewhere = usable & inside, usable & ~inside
    free = int(elsewhere.sum()) - columns.shape[1]
    if free < columns.shape[1] or not here.any():
        return False
    told = columns @ np.linalg.lstsq(columns[elsewhere], means[name][elsewhere])[0]
    squares = (means[name] - told) ** 2
    ratio = float(squares[here].mean()) / max(float(squares[elsewhere].sum()) / free, 1e-300)
    return ratio > float(fdtri(int(here.sum()), free, 1.0 - CLAIM))


def _often_wild(flight: Flight) -> list[Suspicion]:
    """Return sensors and surfaces with so many spikes that they are no wild points."""
    suspicions = []
    for name in flight.channels:
        if name not in _SENSORS and not is_surface(name):
            continue
        values = np.where(flight.usable([name]), flight[name], np.nan)
        share = float(np.mean(spikes(values, rarest=OFTEN)))
        if share > RAREST:
            words = (
                f"{name} has spikes in {100 * share:.2g} % of its samples, too many for wild"
                " points: another field is mixed in, or its converter fails"
            )
            suspicions.append(Suspicion(name, "spikes", words, {"share": share}))
    return suspicions


def _too_large(flight: Flight) -> list[Suspicion]:
    """Return measured angles that exceed a right angle in a tenth of the record or more:
    degrees."""
    suspicions = []
    for name in ("alpha", "beta", "theta"):
        if (
            name in flight
            and name not in flight.estimated
            and (good := flight.usable([name])).any()
        ):
            size = float(np.quantile(np.abs(flight[name][good]), 0.9))
            if size > LARGEST_ANGLE:
                words = f"{name} reaches {size:.3g} rad: it is in degrees, declared as radians"
                suspicions.append(Suspicion(name, "degrees", words, {"quantile_90": size}))
    return suspicions


def _no_share(flight: Flight) -> list[Suspicion]:
    """Return channels from 0 to 1 that reach more: per cents, or pulses of a servo."""
    suspicions = []
    for name in SHARES:
        if name not in flight or not (good := flight.usable([name])).any():
            continue
        most = float(np.quantile(flight[name][good], 1.0 - SELDOM))
        if most > MOST_SHARE:
            unit = "per cent" if most < 100.0 * MOST_SHARE else "microseconds or another unit"
            words = (
                f"{name} reaches {most:.4g}, but is a share from 0 to 1: it is in {unit}; state"
                " the unit in the mapping"
            )
            suspicions.append(Suspicion(name, "unit", words, {"most": most}))
    return suspicions


def _impossible_cg(flight: Flight, span: float | None, chord: float | None) -> list[Suspicion]:
    """Return coordinates of the centre of gravity beyond any aircraft of this size, or that travel
    by more than a chord."""
    farthest = FARTHEST if span is None else min(FARTHEST, FARTHEST_SPANS * span)
    suspicions = []
    for name in _CG:
        if name not in flight or not (good := flight.usable([name])).any():
            continue
        place = float(np.median(flight[name][good]))
        low, high = np.quantile(flight[name][good], [0.01, 0.99])
        if abs(place) > farthest:
            than = "any aircraft is long" if span is None else "this aircraft reaches"
            words = (
                f"{name} is {place:.6g} m from the datum, further than {than}"
                f" ({farthest:.3g} m): its unit is another, or the field is"
            )
            suspicions.append(Suspicion(name, "unit", words, {"median": place, "limit": farthest}))
        elif chord is not None and high - low > chord:
            words = (
                f"{name} travels by {high - low:.3g} m, more than the chord ({chord:.3g}"
                " m): its unit is another, or the field is"
            )
            evidence = {"travel": float(high - low), "limit": chord}
            suspicions.append(Suspicion(name, "unit", words, evidence))
    return suspicions


def _weight(channels: Mapping[str, Array]) -> tuple[list[Suspicion], dict[str, Array]]:
    """Return faults of the accelerations, which must balance the weight along body z on average.

    Also returns the channels with these faults corrected.
    """
    mended, causes = dict(channels), []
    if "az" not in channels:
        return [], mended
    az = float(np.median(channels["az"]))
    ay = float(np.median(channels["ay"])) if "ay" in channels else 0.0
    median = f"the median of az is {az:.2f} m/s^2 and should be near {-GRAVITY:.1f}"
    if abs(az) < 0.4 * GRAVITY and 0.6 * GRAVITY < abs(ay) < 1.6 * GRAVITY:
        words = (
            f"ay balances the weight ({ay:.2f} m/s^2) and az does not ({az:.2f} m/s^2): y and z of"
            " the accelerations are swapped"
        )
        causes.append(("swapped", words))
        mended["ay"], mended["az"] = channels["az"], -np.sign(ay) * channels["ay"]
    elif 0.6 * GRAVITY < az < 1.6 * GRAVITY:
        causes.append(("sign", f"{median}: its sign is flipped (z up)"))
        mended["az"] = -channels["az"]
    elif 0.7 < abs(az) < 1.4 and float(np.median(np.abs(channels["az"] - az))) < LOAD_SPREAD:
        causes.append(
            ("unit", f"{median}: it is in g, declared as m/s^2{', with z up' if az > 0 else ''}")
        )
        mended.update(
            {name: GRAVITY * channels[name] for name in ("ax", "ay", "az") if name in channels}
        )
        mended["az"] = mended["az"] * -np.sign(az)
    elif abs(az) < 0.4 * GRAVITY:
        causes.append(
            (
                "gravity",
                f"{median}: gravity is missing (logged as nz - 1, or as acceleration without"
                " gravity)",
            )
        )
        mended.pop("az")  # its sign is also unknown
    elif abs(az) > 5.0 * GRAVITY:
        causes.append(("unit", f"{median}: it is in another unit"))
        mended.pop("az")
    return [
        Suspicion("az", kind, words, {"median_az": az, "median_ay": ay}) for kind, words in causes
    ], mended


def _copies(channels: Mapping[str, Array]) -> list[Suspicion]:
    """Return angles, rates and accelerations with the history of another of their kind."""
    listed: list[Suspicion] = []
    for kind, other in (pair for names in _ALIKE for pair in combinations(names, 2)):
        if not {kind, other} <= channels.keys():
            continue
        both = np.isfinite(channels[kind]) & np.isfinite(channels[other])
        if both.sum() < FEWEST:
            continue
        one, two = (channels[name][both] - channels[name][both].mean() for name in (kind, other))
        sizes = float(np.std(one)), float(np.std(two))
        if min(sizes) < SWING or not ONE_FIELD < sizes[0] / sizes[1] < 1.0 / ONE_FIELD:
            continue
        left = one - two * float(one @ two) / float(two @ two)
        if float(np.std(left)) < SAME * sizes[0]:
            words = (
                f"{kind} has the history of {other}, which no flight makes equal: one field of the"
                " log was mapped to both"
            )
            listed.append(Suspicion(kind, "copied", words, {"apart": float(np.std(left))}))
    return listed


def _kinematic(channels: Mapping[str, Array], step: float) -> list[Suspicion]:
    """Return the single fault that explains why channels disagree with their kinematics."""
    explanation = explain(channels, step)
    if explanation is None:
        return []
    fault, alike = explanation.fault, explanation.alike
    against = " and ".join(explanation.disagreed)
    words = (
        f"{against} {'disagrees' if len(explanation.disagreed) == 1 else 'disagree'} with rates and"
        f" accelerations: {fault.words}"
    )
    if alike:
        words += (
            f" (this record cannot distinguish it from: {'; '.join(f.words for f in alike[:3])})"
        )
    evidence = {
        "agreement": explanation.before,
        "agreement_when_mended": explanation.after,
        "alternatives": float(len(alike)),
    }
    return [Suspicion(fault.channels[0], fault.kind, words, evidence)]


def _aerodynamic(channels: Mapping[str, Array], step: float) -> list[Suspicion]:
    """Return sign faults that only the forces show.

    Side force opposes sideslip, lift grows with alpha, a banked aircraft turns, forward force
    changes the airspeed. Checked only if the kinematics agree, so that beta is correct when side
    force contradicts it.
    """
    suspicions = []
    if "V" not in channels:
        return []
    flying = channels["V"] > 0.5 * np.max(channels["V"])
    if {"ay", "beta"} <= channels.keys():
        together = _correlation(channels["ay"], channels["beta"], flying)
        if together > WELL_EXPLAINED and float(np.std(channels["beta"][flying])) > SWING:
            words = (
                "ay grows with beta, but side force opposes sideslip: the sign of ay is flipped (or"
                " that of beta)"
            )
            suspicions.append(Suspicion("ay", "sign", words, {"correlation": together}))
    if {"az", "alpha"} <= channels.keys():
        lift = -channels["az"] / np.maximum(channels["V"], 1.0) ** 2
        together = _correlation(lift, channels["alpha"], flying)
        if together < -WELL_EXPLAINED and float(np.std(channels["alpha"][flying])) > SWING:
            words = "lift falls as alpha rises over the record: the sign of alpha is flipped"
            suspicions.append(Suspicion("alpha", "sign", words, {"correlation": together}))
    if {"r", "phi"} <= channels.keys():
        slow = 0.1 if 0.4 / step > 0.1 else 0.4 / step
        together = _correlation(low_passed(channels["r"], step, slow), channels["phi"], flying)
        if together < -WELL_EXPLAINED and float(np.std(channels["phi"][flying])) > SWING:
            words = (
                "the aircraft yaws away from the side to which it banks: the sign of r is flipped"
                " (or those of p and phi)"
            )
            suspicions.append(Suspicion("r", "sign", words, {"correlation": together}))
    if set(KINEMATICS["V"][1]) <= channels.keys():
        suspicions += _forward(channels, step, flying)
    return suspicions


def _forward(
    channels: Mapping[str, Array], step: float, flying: NDArray[np.bool_]
) -> list[Suspicion]:
    """Check that forward force, gravity and lift tilt give the change of airspeed on average."""
    expected = float(np.mean(airspeed_rate(channels)[flying]))
    gained = float(np.sum(np.gradient(channels["V"], step)[flying]) / max(flying.sum(), 1))
    turned = float(
        np.mean(
            (airspeed_rate(channels) - airspeed_rate({**channels, "ax": -channels["ax"]}))[flying]
        )
    )
    missing = expected - gained
    if abs(missing) > 2.0 * ACCELERATION and abs(missing - turned) < 0.25 * abs(missing):
        words = (
            f"ax and gravity give {expected:.2f} m/s^2 on average, but V changes by {gained:.2f}"
            " m/s^2: the sign of ax is flipped"
        )
        return [Suspicion("ax", "sign", words, {"given": expected, "gained": gained})]
    return []


def _correlation(a: Array, b: Array, where: NDArray[np.bool_]) -> float:
    """The correlation of two channels (n,); 0 where chance makes one as large of as many samples as
    are independent (Fisher, Metron 1, 1921)."""
    one, other = a[where], b[where]
    if len(one) < 3 or float(np.std(one)) == 0.0 or float(np.std(other)) == 0.0:
        return 0.0
    found = float(np.corrcoef(one, other)[0, 1])
    slow = min(samples_per_independent(each - each.mean()) for each in (one, other))
    independent = len(one) / slow
    if not independent > 4.0:
        return 0.0
    told = abs(np.arctanh(np.clip(found, -1.0 + 1e-12, 1.0 - 1e-12))) * np.sqrt(independent - 3.0)
    return found if told > ERRORS else 0.0
