"""Check the shapes of what a round found against functions of the observed variables.

docs/method/tracing.md, section 26.
"""

from collections.abc import Mapping, Sequence, Set
from typing import Final

from aerodb.effects import FlightView, Hypothesis, surfaces_of
from aerodb.loop.flight_source import FlightSource, on_each
from aerodb.loop.frozen_library import Library
from aerodb.support import Array
from aerodb.tables import HAT_RATES, AeroDatabase
from aerodb.tracing import (
    FEWEST_SHAPED,
    Finding,
    FlightResidual,
    evidence_of,
    imitations,
    with_checked_shapes,
)

#: Wind axis -> the body axis on which it acts most.
_MAINLY: Final = {"C_drag": "CX", "C_side": "CY", "C_lift": "CZ"}


def checked_shapes(
    source: FlightSource,
    flights: Sequence[str],
    database: AeroDatabase,
    library: Library,
    findings: Sequence[Finding],
) -> tuple[Finding, ...]:
    """Return the findings of a round, given `database`; see `tracing.with_checked_shapes`.

    flights : ids of those that identify. Raises InputError where a flight lacks what is needed.
    """
    claimed = any(f.verdict in ("confirmed", "sensor") for f in findings)
    if len(flights) < FEWEST_SHAPED or not claimed:
        return tuple(findings)
    residuals = _residuals(source, flights, database, library, {f.hypothesis for f in findings})
    return with_checked_shapes(residuals, findings, library.hypotheses, library.settings)


def imitated_shapes(
    source: FlightSource,
    flights: Sequence[str],
    database: AeroDatabase,
    library: Library,
    models: Mapping[str, Sequence[Hypothesis]],
    sensors: Sequence[str] = (),
) -> dict[str, tuple[str, ...]]:
    """Return axis -> variables of what all terms of its increment model (axis -> terms) imitate,
    given `database`; sensors : ids of those that may be wrong. See `tracing.imitations`."""
    body = {_MAINLY.get(axis, axis): axis for axis in models}
    ids = {own: [term.id for term in models[axis]] for own, axis in body.items()}
    wanted = {id for members in ids.values() for id in members}
    residuals = _residuals(source, flights, database, library, wanted)
    found = imitations(residuals, ids, sensors, library.hypotheses, library.settings)
    return {body[own]: variables for own, variables in found.items()}


def _residuals(
    source: FlightSource,
    flights: Sequence[str],
    database: AeroDatabase,
    library: Library,
    terms: Set[str],
) -> list[FlightResidual]:
    """Residuals with the columns of terms and of all sensors, and the variables of shapes."""
    columns = [h for h in library.hypotheses if h.kind == "sensor" or h.id in terms]

    def residual(id: str) -> FlightResidual:
        view = source.view(id, database, library.settings.bandwidth)
        return FlightResidual(evidence_of(view, columns), shape_variables(view))

    return on_each(source, flights, residual)


def shape_variables(view: FlightView) -> dict[str, Array]:
    """Return what an effect may depend on, name -> (n,): flow angles, rates, deflections, Mach
    number, height above ground, thrust over dynamic pressure, time.

    All are in SI units.
    """
    surfaces = {surface.channel for surface in surfaces_of(view.vehicle, view.channels)}
    names = {"alpha", "beta", "mach", "height_above_ground", *HAT_RATES, *surfaces}
    if "mach" not in view.channels:
        names.add("qbar")
    variables = {name: view[name] for name in sorted(names) if view.has([name])}
    variables["time"] = view.time - view.time[0]
    if view.has(["thrust", "qbar"]):
        variables["thrust"] = view["thrust"] * view.inverse_pressure
    return variables
