"""Conditioning of one flight: its flags, and the findings on it as one document."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from aerodb.conditioning.delay import Delay
from aerodb.conditioning.failures import flag_failed
from aerodb.conditioning.saturated import flag_saturated
from aerodb.conditioning.segment import Segment
from aerodb.conditioning.segmentation import flag_on_ground
from aerodb.conditioning.suspicion import Suspicion
from aerodb.conditioning.wild_points import flag_wild_points
from aerodb.flight import Flight


@dataclass(frozen=True)
class Conditioning:
    """Findings of conditioning: likely faults, segments, and the delay of each channel."""

    suspicions: tuple[Suspicion, ...]
    segments: tuple[Segment, ...]
    delays: tuple[Delay, ...]


def flag_unusable(flight: Flight) -> Flight:
    """Return the flight with wild points, failed and clipped sensors, and samples on the ground
    flagged; values (n,) stay, in SI units (`FLAGS`)."""
    return flag_saturated(flag_on_ground(flag_failed(flag_wild_points(flight))))


def suspicion_documents(suspicions: Iterable[Suspicion]) -> list[dict[str, Any]]:
    """Return suspicions as JSON, figures in SI units; `suspicions_from` reads them back."""
    return [
        {**asdict(suspicion), "evidence": _finite(suspicion.evidence)} for suspicion in suspicions
    ]


def suspicions_from(documents: Iterable[Mapping[str, Any]]) -> tuple[Suspicion, ...]:
    """Return the suspicions that `suspicion_documents` made to JSON, figures in SI units."""
    return tuple(Suspicion(**entry) for entry in documents)


def to_document(conditioning: Conditioning) -> dict[str, Any]:
    """Return the findings as JSON, times [s] and figures in SI units; an infinite standard error
    becomes None."""
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
    """Return the findings in a document of `to_document`, in SI units; KeyError for another
    document."""
    return Conditioning(
        suspicions_from(document["suspicions"]),
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
