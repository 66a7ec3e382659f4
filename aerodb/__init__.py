"""Aerodynamic databases kept true to flight: from flight logs to a traced new database version.

As a library (`aerodb.flows.library`):

    import aerodb

    log = aerodb.load("flight.ulg", vehicle="glider.toml")
    measured = aerodb.total_coefficients(aerodb.reconstruct(log))
    compared = aerodb.compare(measured, aerodb.load_database("handbook.toml"))
    print(compared.report())

The way through the science packages, in the order in which a flight passes them:

- `recording`, `logs`: a `Recording` (topics as logged) and a mapping file give a `Flight`.
- `flight`, `nomenclature`, `units`, `vehicle`: canonical channels in SI and body axes on one time
  grid, and the vehicle file (geometry, mass, surfaces, sensors).
- `conditioning`: flags for unusable samples, segments, delays, duplicates.
- `suspicions`: what looks wrong: plausibility, and a flight against its vehicle by physics.
- `consistency`: flight-path reconstruction; sensor errors, a consistent trajectory and a verdict.
- `coefficients`: measured coefficients with their uncertainty, and residuals against a database.
- `tables`: the aerodynamic database: breakpoint tables, build-up, increments, evaluation.
- `increments`: fits of increments to residuals, validation on held-out flights, promotion gate.
- `effects`: the library of candidate causes (aerodynamic, stall, measurement) of a residual.
- `tracing`: which of these causes the flights support, tested across flights.
- `loop`: the closed loop: trace, correct, trace again, until nothing is left to find.
- `report`: documents and figures of findings, updates and versions.
- `exchange`: import and export of databases (native files, DAVE-ML, JSBSim).
- `simulation`, `examples`: flights with known truth, and the worked example.
- `support`, `estimation`, `physics`, `five_hole`, `quantities`, `remarks`, `errors`: what the
  others stand on.

Around them: `aerodb.storage` (files, catalogue, workspace), `aerodb.tasks` (one stored step each)
and `aerodb.flows` (command line, web console, orchestration). A package's public names are those
of its ``__init__``; see each package's docstring for where to begin.
"""

from typing import Any

import lazy_loader as lazy

_of_library, __dir__, __all__ = lazy.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Return a public name of the library; its module is imported when it is first asked for.

    Raises AeroError on a system that is not supported.
    """
    if name == "__version__":
        from importlib.metadata import version  # slow to import

        return version("aerodb")
    from aerodb.support import require_supported_system

    require_supported_system()
    return _of_library(name)
