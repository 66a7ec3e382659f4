"""What tracing finds in moving air, whose rotation no gyro shows.

docs/method/tracing.md, section 4.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.loop.evidence import noise_within_limits, normal_equations_beside
from aerodb.loop.flight_source import FlightSource, on_each
from aerodb.loop.frozen_library import Library
from aerodb.support import HALF
from aerodb.tables import AeroDatabase
from aerodb.tracing import (
    Traced,
    driven_by_rates,
    lost_in_rotating_air,
    only_suspected,
    roll_rates,
    trace,
)

#: The air evidently moves where it rolls more than half as fast as the aircraft. Half of the roll
#: damping could then be air, if the aircraft follows it altogether.
_MOVING: Final = HALF


def rolling_share(
    source: FlightSource, flights: Sequence[str], database: AeroDatabase, library: Library
) -> float:
    """Return how fast the air rolled in these flights (ids), as a part of the aircraft's own rate.

    As vanes show it beyond what they may be wrong (`roll_rates`), over all flights together and in
    the band of tracing. Zero without a vane or a roll rate.

    It is dimensionless.
    """

    def rates(flight: str) -> tuple[float, float]:
        reconstruction = source.reconstruction(flight)
        if reconstruction.noise is None or "alpha" not in reconstruction.noise.unsteady:
            return 0.0, 0.0  # no vane that could have shown it
        view = source.view(flight, database, library.settings.bandwidth)
        noise = noise_within_limits(reconstruction, view, library.settings)
        span, band = source.vehicle.reference.span, library.settings.bandwidth
        return (0.0, 0.0) if noise is None else roll_rates(noise, view.recorded, span, band)

    air, own = np.linalg.norm(on_each(source, flights, rates), axis=0)
    return float(air / own) if own > 0.0 else 0.0


def evidently_moving(
    source: FlightSource, flights: Sequence[str], database: AeroDatabase, library: Library
) -> bool:
    """Return whether the air evidently rolled in these flights (ids).

    The measure is `rolling_share`, which is dimensionless.
    """
    return rolling_share(source, flights, database, library) > _MOVING


def beside_rotating_air(
    source: FlightSource,
    traced: Traced,
    database: AeroDatabase,
    library: Library,
    earlier: Mapping[str, float],
) -> Traced:
    """Return the findings that hold with the rotation of the air in gusts in the model.

    traced : as found without it; earlier : as in `trace`. Where the air evidently moved, every
    finding is tested with its rotation; if one is lost, the search is repeated with it, and only
    what both find is claimed. Elsewhere a finding of a rate that is lost is suspected. Values are
    in the unit of each hypothesis. Raises InputError where a flight lacks what is needed.
    """
    if not traced.findings:
        return traced
    known = {hypothesis.id: hypothesis for hypothesis in library.hypotheses}
    moving = evidently_moving(source, traced.flights, database, library)
    examined = {
        finding.hypothesis
        for finding in traced.findings
        if finding.hypothesis in known and (moving or driven_by_rates(known[finding.hypothesis]))
    }
    if not examined:
        return traced
    settings = library.settings
    normal_equations = normal_equations_beside(
        source, traced.flights, database, library, rotating_air=True
    )
    lost = examined & lost_in_rotating_air(
        traced.findings, normal_equations, library.hypotheses, settings, earlier
    )
    if not lost:
        return traced
    if moving:
        again = trace(normal_equations, library.hypotheses, settings, earlier)
        return claimed_by_both(traced, again)
    because = "the rotation of the air in gusts, which no gyro shows, would explain it as well"
    findings = tuple(
        only_suspected(each, because)
        if each.hypothesis in lost and each.verdict in ("confirmed", "alias_group")
        else each
        for each in traced.findings
    )
    return replace(traced, findings=findings)


def claimed_by_both(still: Traced, rotating: Traced) -> Traced:
    """Return the search with rotating air, with only the findings that the other names too.

    still : without the rotation, where gusts look like effects; rotating : with it, where a
    flight's share of it may take a part of an effect and leave the rest to another name.
    """
    named = {name for each in still.findings for name in (each.hypothesis, *each.explanation_set)}
    findings = tuple(each for each in rotating.findings if each.hypothesis in named)
    claimed = {each.hypothesis for each in findings}
    every = {each.hypothesis for each in (*still.findings, *rotating.findings)}
    undecided = ", ".join(sorted(every - claimed))
    note = (
        f"Not decidable in the moving air of these flights: {undecided}. The rotation of the air in"
        " gusts, which no gyro shows, explains as much; fly in calm air to decide."
    )
    return replace(
        rotating, findings=findings, notes=(*rotating.notes, *([note] if undecided else ()))
    )
