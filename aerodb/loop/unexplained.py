"""What flights still have in common after the candidate, and no hypothesis of the library names.

docs/method/tracing.md, section 14.
"""

from collections.abc import Sequence

from aerodb.effects import view_of
from aerodb.loop.flights import FlightSource, thinned_comparison
from aerodb.loop.library import Library
from aerodb.support import in_threads
from aerodb.tables import HAT_RATES, AeroDatabase
from aerodb.tracing import FlightResidual, UnexplainedResidual, evidence_of, unexplained_by_axis


def unexplained_residuals(
    source: FlightSource, flights: Sequence[str], candidate: AeroDatabase, library: Library
) -> tuple[UnexplainedResidual, ...]:
    """Return what is unexplained on each axis of these flights (ids), compared with the candidate.

    Empty below the fewest flights of the settings.
    """
    if len(flights) < library.settings.fewest:
        return ()
    sensors = [hypothesis for hypothesis in library.hypotheses if hypothesis.kind == "sensor"]

    def left(id: str) -> FlightResidual:
        flight, comparison = thinned_comparison(source, id, candidate, library.settings.bandwidth)
        view = view_of(flight, comparison, candidate, source.vehicle)
        names = {*candidate.flight_inputs, *HAT_RATES}
        variables = {name: view.channels[name] for name in sorted(names) if view.has([name])}
        return FlightResidual(
            evidence_of(flight, comparison, candidate, source.vehicle, sensors, view=view),
            variables,
        )

    return unexplained_by_axis(in_threads(left, flights), library.settings)
