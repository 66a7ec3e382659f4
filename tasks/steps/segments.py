"""Segments of a stored flight, as conditioning found them."""

from dataclasses import replace

from aerodb.conditioning import Segment
from aerodb.tasks.steps.conditioning import load_conditioning
from aerodb.tasks.steps.ingest import load_flight
from aerodb.tasks.workspace_access import WorkspaceAccess


def segments_of(access: WorkspaceAccess, flight: str, run: str) -> tuple[Segment, ...]:
    """Return the segments of a flight (its id); start and end [s] from its first sample.

    Reads the findings of `load_conditioning`. Raises UnknownNameError for an unknown id.
    """
    row = access.catalogue.flight(flight)
    channels, key = load_flight(access, row, run)
    conditioning, _ = load_conditioning(access, row, channels, key, run)
    first = float(channels.time[0])
    return tuple(
        replace(each, start=each.start - first, end=each.end - first)
        for each in conditioning.segments
    )
