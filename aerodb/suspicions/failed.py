"""Sensors that failed or were clipped in flight, as suspicions: the stretch is left out already."""

from typing import Final

import numpy as np

from aerodb.conditioning import CLIPPED, Suspicion, failures, saturated
from aerodb.flight import Flight
from aerodb.nomenclature import channel
from aerodb.signals import runs

#: Kind of such a suspicion: the flight stays.
FAILED: Final = "failed"


def failed_suspicions(flight: Flight) -> tuple[Suspicion, ...]:
    """Return a suspicion for each stretch in which a sensor failed, and for each sensor that is
    clipped; both are flagged by `aerodb.conditioning.flag_unusable`.

    Times [s]; channels are (n,). Source: `docs/method/consistency.md`, section "Sensors that fail
    in flight".
    """
    failed = tuple(
        Suspicion(
            each.channel,
            FAILED,
            f"{each.sensor} failed from {each.start:.1f} to {each.end:.1f} s: {each.reason}; the"
            " stretch is left out",
            {"from": each.start, "to": each.end, "value": each.value, "beside": each.beside},
        )
        for each in failures(flight)
    )
    clipped = (_clipped(flight, name) for name in CLIPPED if name in flight)
    return (*failed, *(each for each in clipped if each is not None))


def _clipped(flight: Flight, name: str) -> Suspicion | None:
    """What is said of a sensor that stands at the ends of its range; None where it does not."""
    where = saturated(flight, name)
    stretches = runs(where)
    if not stretches:
        return None
    values = flight[name][where]
    ends = " and ".join(f"{end:.3g}" for end in np.unique(values))
    since, seconds = float(flight.time[stretches[0][0]]), flight.step * float(where.sum())
    words = (
        f"{name} comes to {ends} {channel(name).unit} {len(stretches)} times and stands there,"
        f" {seconds:.1f} s in all, first at {since:.1f} s. Its sensor or its channel is clipped;"
        " these samples are left out"
    )
    evidence = {"from": since, "seconds": seconds, "times": float(len(stretches))}
    return Suspicion(name, FAILED, words, evidence)
