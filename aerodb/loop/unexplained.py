"""What flights still have in common after the candidate, and no hypothesis of the library names.

docs/method/tracing.md, section 14.
"""

from collections.abc import Sequence

from aerodb.coefficients import Comparison
from aerodb.effects import view_of
from aerodb.flight import Flight
from aerodb.loop.evidence import copies_with_noise
from aerodb.loop.flights import FlightSource, thinned_comparison
from aerodb.loop.library import Library
from aerodb.loop.shapes import shape_variables
from aerodb.support import in_threads
from aerodb.tables import HAT_RATES, AeroDatabase
from aerodb.tracing import (
    FlightResidual,
    UnexplainedResidual,
    evidence_of,
    unexplained_by_axis,
    without_state_noise,
)


def unexplained_residuals(
    source: FlightSource, flights: Sequence[str], candidate: AeroDatabase, library: Library
) -> tuple[UnexplainedResidual, ...]:
    """Return what is unexplained on each axis of these flights (ids), compared with the candidate.

    Empty below the fewest flights of the settings.
    """
    if len(flights) < library.settings.fewest:
        return ()
    settings = library.settings
    sensors = [hypothesis for hypothesis in library.hypotheses if hypothesis.kind == "sensor"]

    def beside(flight: Flight, comparison: Comparison) -> FlightResidual:
        view = view_of(flight, comparison, candidate, source.vehicle)
        names = {*candidate.flight_inputs, *HAT_RATES}
        variables = {name: view.channels[name] for name in sorted(names) if view.has([name])}
        return FlightResidual(
            evidence_of(flight, comparison, candidate, source.vehicle, sensors, view=view),
            variables,
            shape_variables(view),
        )

    def left(id: str) -> FlightResidual:
        return beside(*thinned_comparison(source, id, candidate, settings.bandwidth))

    def noisier(id: str) -> list[FlightResidual]:
        flight, comparison = thinned_comparison(source, id, candidate, settings.bandwidth)
        view = view_of(flight, comparison, candidate, source.vehicle)
        copies = copies_with_noise(
            flight,
            source.flight(id).duration,
            source.reconstruction(id),
            view,
            comparison,
            settings,
            rotating_air=True,
        )
        return [beside(*copy) for copy in copies]

    found = unexplained_by_axis(in_threads(left, flights), settings)
    if not any(each.found for each in found):
        return found
    copies = list(zip(*in_threads(noisier, flights), strict=False))
    noisy = [unexplained_by_axis(copy, settings) for copy in copies]
    return without_state_noise(found, noisy, settings) if noisy else found
