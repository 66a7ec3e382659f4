"""What sensors and vehicle data that were found to be wrong leave in a comparison.

It is no error of the database: what is judged by the size of an error, a constant or the gain of an
increment model, is judged without it. docs/method/tracing.md, sections 13 and 27.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace

from aerodb.coefficients import Comparison
from aerodb.effects import with_wind
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.support import in_threads
from aerodb.tables import AeroDatabase
from aerodb.tracing import Finding


def found_sensors(findings: Collection[Finding]) -> dict[str, float]:
    """Return the ids of the sensors that were found to be wrong, and by how much, in the unit of
    each hypothesis (SI)."""
    return {each.hypothesis: each.value for each in findings if each.verdict == "sensor"}


def without_sensors(
    source: FlightSource,
    flights: Collection[str],
    database: AeroDatabase,
    library: Library,
    sensors: Mapping[str, float],
) -> dict[str, Comparison]:
    """Return flight (id) -> its comparison with a database, measured coefficients (n,) without what
    these sensors (id -> error, SI) add to them.

    Raises InputError where a flight lacks what is needed.
    """
    found = [(each, sensors[each.id]) for each in library.hypotheses if each.id in sensors]

    def one(flight: str) -> Comparison:
        compared = source.comparison(flight, database)
        if not found:
            return compared
        view, measured = source.view(flight, database), dict(compared.measured)
        for hypothesis, value in found:
            for axis, column in with_wind(view, hypothesis.columns(view)).items():
                if axis in measured:
                    measured[axis] = measured[axis] - value * column
        return replace(compared, measured=measured)

    return dict(zip(flights, in_threads(one, [*flights]), strict=True))
