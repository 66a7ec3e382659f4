"""Sensors that failed in flight, as suspicions: the stretch is left out already."""

from typing import Final

from aerodb.conditioning import Suspicion, failures
from aerodb.flight import Flight

#: Kind of such a suspicion: the flight stays.
FAILED: Final = "failed"


def failed_suspicions(flight: Flight) -> tuple[Suspicion, ...]:
    """Return a suspicion for each stretch in which a sensor failed, flagged by
    `aerodb.conditioning.flag_unusable`.

    Times [s]; channels are (n,). Source: `docs/method/consistency.md`, section "Sensors that fail
    in flight".
    """
    return tuple(
        Suspicion(
            each.channel,
            FAILED,
            f"{each.sensor} failed from {each.start:.1f} to {each.end:.1f} s: {each.reason}; the"
            " stretch is left out",
            {"from": each.start, "to": each.end, "value": each.value, "beside": each.beside},
        )
        for each in failures(flight)
    )
