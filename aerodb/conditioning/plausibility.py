"""What is likely wrong with a record before anything is estimated from it, in plain sentences that
name the cause.

Evidence is that topics do not meet, that sensors stand still, that the accelerations do not carry
the weight, and that channels disagree with their kinematics (`hypotheses`). Errors of a few
percent, biases and delays raise no suspicion here: they are for flight-path reconstruction.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning.channel_rates import GRAVITY, KINEMATICS, airspeed_rate, with_accelerations
from aerodb.conditioning.differentiation import low_passed
from aerodb.conditioning.hypotheses import explain
from aerodb.conditioning.resampling import decimated
from aerodb.conditioning.wild_points import stuck
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS
from aerodb.recording import Recording
from aerodb.support import Array

_ACCELERATIONS = ("ax", "ay", "az", "ax_imu", "ay_imu", "az_imu")
#: Sensors that must move when the aircraft does.
_SENSORS = ("p", "q", "r", *_ACCELERATIONS, "alpha", "beta", "phi", "theta")
#: Least motion [rad, rad/s] of two others, and share of a record that a sensor must hold one value,
#: to be called stuck.
LEAST_MOTION, LEAST_SHARE = 2e-3, 0.02
#: Correlation that is no chance, least swing [rad] of an air angle for it, least force over mass
#: [m/s^2] that must be missing.
STRONG, LEAST_SWING, LEAST_FORCE = 0.7, 0.005, 0.4
#: Least swing [rad] of bank that must turn the aircraft.
LEAST_BANK = 0.1
#: Load factor usually stays this near its middle: what varies more around 1 is no load factor but
#: lacks gravity.
LOAD_SPREAD = 0.7
#: Hz at least at which channels are compared with their kinematics, which is done below 1 Hz.
RATE = 10.0
#: Time stamps from which a topic is a record of something.
FEWEST_STAMPS = 10
#: Largest angle [rad] that alpha, beta or theta can show.
LARGEST_ANGLE = np.pi / 2 + 0.1


@dataclass(frozen=True)
class Suspicion:
    """A likely fault: the channel (or topic), the kind, one plain sentence with the likely cause,
    the figures behind it.

    Kinds: ``no_overlap stuck sign degrees radians gravity swapped unit``.
    """

    channel: str
    kind: str
    sentence: str
    evidence: Mapping[str, float]


def suspicions(flight: Flight) -> tuple[Suspicion, ...]:
    """Everything about a flight that looks like a fault of wiring, sign, unit or declaration; empty
    for a good record.

    Samples flagged as stuck or implausible are looked at all the same: they are the evidence. Looks
    for channels without a sample in common with the rates; sensors that stand still while others
    move; gravity missing from the vertical acceleration, its sign or unit; a rate, attitude, air
    angle or acceleration of wrong sign, degrees declared as radians and the reverse, axes
    exchanged. Of several faults of the last kind it names one: mend it and ask again. A record in
    which nothing moves tells little and raises few.
    """
    hidden = np.uint8(FLAGS["stuck"] | FLAGS["implausible"])
    flight = replace(flight, flags={name: bits & ~hidden for name, bits in flight.flags.items()})
    found = [*_without_samples(flight), *_standing_still(flight), *_too_large(flight)]
    unusable = {suspicion.channel for suspicion in found}
    channels = {
        name: values for name, values in with_accelerations(flight).items() if name not in unusable
    }
    vertical, channels = _weight(channels)
    found += vertical
    if len(flight.time) >= 32 and channels:
        thin, step = decimated(channels, flight.step, RATE)
        found += _kinematic(thin, step) or _aerodynamic(thin, step)
    return tuple(found)


def clock_suspicions(recording: Recording) -> tuple[Suspicion, ...]:
    """Topics whose time stamps do not overlap with those of more than half of the others, with the
    likely cause.

    Topics of a moment (fewer than ten samples, or all at once) are events, not records: they are
    left out.
    """
    lasting = {
        name: t.time
        for name, t in recording.topics.items()
        if len(t.time) >= FEWEST_STAMPS and t.time[-1] > t.time[0]
    }
    spans = {name: (float(time[0]), float(time[-1])) for name, time in lasting.items()}
    found = []
    for name, (start, end) in spans.items():
        others = [span for other, span in spans.items() if other != name]
        apart = [span for span in others if span[0] > end or span[1] < start]
        if not others or (2 * len(apart) <= len(others) and len(others) > 1) or not apart:
            continue
        low, high = min(span[0] for span in others), max(span[1] for span in others)
        cause = "its clock is another one"
        if start > 1e8 > high:
            cause = "its stamps look like UTC, the others like time since start-up"
        elif (end - start) > 300.0 * (high - low):
            cause = "its stamps look like milli- or microseconds"
        sentence = (
            f"topic {name} runs from {start:.10g} to {end:.10g} s, the others from {low:.10g} to"
            f" {high:.10g} s: {cause}"
        )
        evidence = {"start": start, "end": end, "others_start": low, "others_end": high}
        found.append(Suspicion(name, "no_overlap", sentence, evidence))
    return tuple(found)


def _without_samples(flight: Flight) -> list[Suspicion]:
    """Channels that have no usable sample at a time when rates or accelerations have any."""
    core = [name for name in ("p", "q", "r", *_ACCELERATIONS) if name in flight]
    reference = (
        np.any([flight.usable([name]) for name in core], axis=0) if core else flight.usable()
    )
    found = []
    for name in flight.channels:
        if reference.any() and not (flight.usable([name]) & reference).any():
            sentence = (
                f"{name} has no usable sample while rates and accelerations have: their topics do"
                " not overlap in time"
            )
            found.append(
                Suspicion(
                    name, "no_overlap", sentence, {"usable": float(flight.usable([name]).sum())}
                )
            )
    return found


def _standing_still(flight: Flight) -> list[Suspicion]:
    """Sensors that never change, or hold one value for long, while at least two others move."""
    present = {name: flight[name][flight.usable([name])] for name in _SENSORS if name in flight}
    present = {name: values for name, values in present.items() if len(values) > 1}
    moving = [name for name, values in present.items() if float(np.std(values)) > LEAST_MOTION]
    found = []
    for name, values in present.items():
        others = [other for other in moving if other != name]
        held = stuck(np.where(flight.usable([name]), flight[name], np.nan), flight.step, jump=False)
        constant = float(np.ptp(values)) == 0.0
        if held.any() and not constant:  # who moved just then?
            others = [
                other
                for other in others
                if float(np.std(flight[other][held])) > 0.3 * float(np.std(present[other]))
            ]
        share = 1.0 if constant else float(np.mean(held))
        if share > LEAST_SHARE and len(others) >= 2:
            since = float(flight.time[np.argmax(held)]) if held.any() else float(flight.time[0])
            what = "never changes" if constant else f"stands still from {since:.6g} s"
            words = (
                f"{name} {what} while {others[0]} and {others[1]} move: its sensor is stuck, or was"
                " not recorded"
            )
            found.append(
                Suspicion(
                    name,
                    "stuck",
                    words,
                    {"share": share, "from": since, "value": float(values[-1])},
                )
            )
    return found


def _too_large(flight: Flight) -> list[Suspicion]:
    """Angles that can only be degrees: what goes beyond a right angle for a tenth of the record or
    more."""
    found = []
    for name in ("alpha", "beta", "theta"):
        if name in flight and (good := flight.usable([name])).any():
            size = float(np.quantile(np.abs(flight[name][good]), 0.9))
            if size > LARGEST_ANGLE:
                words = f"{name} reaches {size:.3g} rad: it is in degrees, declared as radians"
                found.append(Suspicion(name, "degrees", words, {"quantile_90": size}))
    return found


def _weight(channels: Mapping[str, Array]) -> tuple[list[Suspicion], dict[str, Array]]:
    """On average the accelerations carry the weight along body z: what does not, and the channels
    with that mended."""
    mended, found = dict(channels), []
    if "az" not in channels:
        return [], mended
    az = float(np.median(channels["az"]))
    ay = float(np.median(channels["ay"])) if "ay" in channels else 0.0
    seen = f"az is {az:.2f} m/s^2 in the middle of its values and must be near {-GRAVITY:.1f}"
    if abs(az) < 0.4 * GRAVITY and 0.6 * GRAVITY < abs(ay) < 1.6 * GRAVITY:
        words = (
            f"ay carries the weight ({ay:.2f} m/s^2) and az does not ({az:.2f} m/s^2): y and z of"
            " the accelerations are swapped"
        )
        found.append(("swapped", words))
        mended["ay"], mended["az"] = channels["az"], -np.sign(ay) * channels["ay"]
    elif 0.6 * GRAVITY < az < 1.6 * GRAVITY:
        found.append(("sign", f"{seen}: its sign is flipped (z up)"))
        mended["az"] = -channels["az"]
    elif 0.7 < abs(az) < 1.4 and float(np.median(np.abs(channels["az"] - az))) < LOAD_SPREAD:
        found.append(
            ("unit", f"{seen}: it is in g, declared as m/s^2{', with z up' if az > 0 else ''}")
        )
        mended.update(
            {name: GRAVITY * channels[name] for name in ("ax", "ay", "az") if name in channels}
        )
        mended["az"] = mended["az"] * -np.sign(az)
    elif abs(az) < 0.4 * GRAVITY:
        found.append(
            (
                "gravity",
                f"{seen}: gravity is missing (logged as nz - 1, or as acceleration without weight)",
            )
        )
        mended.pop("az")  # its sign is unknown as well
    elif abs(az) > 5.0 * GRAVITY:
        found.append(("unit", f"{seen}: it is in another unit"))
        mended.pop("az")
    return [
        Suspicion("az", kind, words, {"median_az": az, "median_ay": ay}) for kind, words in found
    ], mended


def _kinematic(channels: Mapping[str, Array], step: float) -> list[Suspicion]:
    """The single fault that explains why channels disagree with their kinematics."""
    explanation = explain(channels, step)
    if explanation is None:
        return []
    fault, alike = explanation.fault, explanation.alike
    against = " and ".join(explanation.disagreed)
    words = (
        f"{against} {'does' if len(explanation.disagreed) == 1 else 'do'} not follow rates and"
        f" accelerations: {fault.words}"
    )
    if alike:
        words += (
            f" (this record cannot tell it from: {'; '.join(other.words for other in alike[:3])})"
        )
    evidence = {
        "agreement": explanation.before,
        "agreement_when_mended": explanation.after,
        "alternatives": float(len(alike)),
    }
    return [Suspicion(fault.channels[0], fault.kind, words, evidence)]


def _aerodynamic(channels: Mapping[str, Array], step: float) -> list[Suspicion]:
    """Signs that only forces tell: side force opposes sideslip, lift grows with alpha, forward
    force moves the airspeed.

    Asked when the kinematics agree, so that beta is right when side force contradicts it.
    """
    found = []
    if "V" not in channels:
        return []
    flying = channels["V"] > 0.5 * np.max(channels["V"])
    if {"ay", "beta"} <= channels.keys():
        together = _correlation(channels["ay"], channels["beta"], flying)
        if together > STRONG and float(np.std(channels["beta"][flying])) > LEAST_SWING:
            words = (
                "ay grows with beta, but side force opposes sideslip: the sign of ay is flipped (or"
                " that of beta)"
            )
            found.append(Suspicion("ay", "sign", words, {"correlation": together}))
    if {"az", "alpha"} <= channels.keys():
        lift = -channels["az"] / np.maximum(channels["V"], 1.0) ** 2
        together = _correlation(lift, channels["alpha"], flying)
        if together < -STRONG and float(np.std(channels["alpha"][flying])) > LEAST_SWING:
            words = "lift falls as alpha rises over the whole record: the sign of alpha is flipped"
            found.append(Suspicion("alpha", "sign", words, {"correlation": together}))
    if {"r", "phi"} <= channels.keys():
        slow = 0.1 if 0.4 / step > 0.1 else 0.4 / step
        together = _correlation(low_passed(channels["r"], step, slow), channels["phi"], flying)
        if together < -STRONG and float(np.std(channels["phi"][flying])) > LEAST_BANK:
            words = (
                "r turns away from the side to which the aircraft banks: the sign of r is flipped"
                " (or those of p and phi)"
            )
            found.append(Suspicion("r", "sign", words, {"correlation": together}))
    if set(KINEMATICS["V"][1]) <= channels.keys():
        found += _forward(channels, step, flying)
    return found


def _forward(
    channels: Mapping[str, Array], step: float, flying: NDArray[np.bool_]
) -> list[Suspicion]:
    """Over the record, forward force, gravity and the tilt of lift must give the change of
    airspeed."""
    given = float(np.mean(airspeed_rate(channels)[flying]))
    gained = float(np.sum(np.gradient(channels["V"], step)[flying]) / max(flying.sum(), 1))
    turned = float(
        np.mean(
            (airspeed_rate(channels) - airspeed_rate({**channels, "ax": -channels["ax"]}))[flying]
        )
    )
    missing = given - gained
    if abs(missing) > LEAST_FORCE and abs(missing - turned) < 0.25 * abs(missing):
        words = (
            f"ax and gravity ask for {given:.2f} m/s^2 on average, V changes by {gained:.2f}: the"
            " sign of ax is flipped"
        )
        return [Suspicion("ax", "sign", words, {"given": given, "gained": gained})]
    return []


def _correlation(a: Array, b: Array, where: NDArray[np.bool_]) -> float:
    one, other = a[where], b[where]
    if len(one) < 3 or float(np.std(one)) == 0.0 or float(np.std(other)) == 0.0:
        return 0.0
    return float(np.corrcoef(one, other)[0, 1])
