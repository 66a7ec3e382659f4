"""Conditioning of one flight: the order of its steps, and its findings as one document."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from aerodb.conditioning.delay import Delay, delays
from aerodb.conditioning.plausibility import Suspicion, suspicions
from aerodb.conditioning.segmentation import Segment, flag_on_ground, ground_and_air, segments
from aerodb.conditioning.wild_points import flag_wild_points
from aerodb.flight import Flight


@dataclass(frozen=True)
class Conditioning:
    """Findings of conditioning: likely faults, segments, and the delay of each channel."""

    suspicions: tuple[Suspicion, ...]
    segments: tuple[Segment, ...]
    delays: tuple[Delay, ...]


def flag_unusable(flight: Flight) -> Flight:
    """Return the flight with wild points and samples on the ground flagged; values stay."""
    return flag_on_ground(flag_wild_points(flight))


def examine(
    flight: Flight,
    clocks: tuple[Suspicion, ...] = (),
    span: float | None = None,
    chord: float | None = None,
) -> Conditioning:
    """Return the findings on a flight whose unusable samples are flagged.

    clocks : suspicions about the time stamps of its recording (`clock_suspicions`). span, chord :
    of the vehicle [m], where it is known. Delays are estimated over the longest airborne stretch.
    """
    flight_segments = segments(flight)
    return Conditioning(
        (*clocks, *suspicions(flight, span, chord)),
        flight_segments,
        delays(flight, during=_longest_in_the_air(flight)),
    )


def _longest_in_the_air(flight: Flight) -> tuple[float, float] | None:
    """Return start and end [s] of the longest airborne stretch; None if airspeed is not known."""
    flown = [segment for segment in ground_and_air(flight) if segment.kind == "airborne"]
    longest = max(flown, key=lambda segment: segment.end - segment.start, default=None)
    return None if longest is None else (longest.start, longest.end)


def suspicion_documents(suspicions: Iterable[Suspicion]) -> list[dict[str, Any]]:
    """Return suspicions as JSON."""
    return [
        {**asdict(suspicion), "evidence": _finite(suspicion.evidence)} for suspicion in suspicions
    ]


def to_document(conditioning: Conditioning) -> dict[str, Any]:
    """Return the findings as JSON; an infinite standard error becomes None."""
    delays = [asdict(delay) for delay in conditioning.delays]
    for delay in delays:
        delay["standard_error"] = (
            delay["standard_error"] if np.isfinite(delay["standard_error"]) else None
        )
    return {
        "suspicions": suspicion_documents(conditioning.suspicions),
        "segments": [asdict(segment) for segment in conditioning.segments],
        "delays": delays,
    }


def from_document(document: Mapping[str, Any]) -> Conditioning:
    """Return the findings in a document of `to_document`."""
    return Conditioning(
        tuple(Suspicion(**entry) for entry in document["suspicions"]),
        tuple(Segment(**entry) for entry in document["segments"]),
        tuple(
            Delay(
                **{
                    **d,
                    "standard_error": np.inf
                    if d["standard_error"] is None
                    else d["standard_error"],
                }
            )
            for d in document["delays"]
        ),
    )


def _finite(evidence: Mapping[str, float]) -> dict[str, float]:
    """Return the finite values, which JSON can hold."""
    return {name: float(value) for name, value in evidence.items() if np.isfinite(value)}
