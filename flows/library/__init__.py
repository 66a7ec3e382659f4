"""The library: what ``import aerodb`` gives a Python user, as plain functions and frozen results.

The way through, without a workspace:

1. `load` reads a log in a confined process, maps it and conditions it: a `Log`.
2. `reconstruct` makes it consistent: a `ReconstructedFlight` with sensor errors and a verdict.
3. `total_coefficients` gives `MeasuredCoefficients`; `compare` puts them beside a database, which
   `load_database` reads: a `ComparedFlight`.
4. `trace` names what the residuals of several flights have in common: `TracedFlights`, with a
   candidate database. `fit` estimates a declared model by any method: a `FittedModel`.
5. `evaluate` gives the coefficients of a database at points: `EvaluatedPoints`.

`open_workspace` reads what the commands have stored, and `Client` what a console serves.

Every result has `report` (text), `to_pandas`, `to_xarray`, and is shown as a table in a notebook.
They call the functions of the science packages that the commands call; nothing is computed here.

Modules: `views` (text, HTML, pandas, xarray), `logs`, `flights`, `tracing`, `fitting`,
`evaluation`, `workspaces`, `client`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .client import Client
    from .evaluation import EvaluatedPoints, evaluate
    from .fitting import FittedModel, fit
    from .flights import (
        ComparedFlight,
        MeasuredCoefficients,
        ReconstructedFlight,
        compare,
        reconstruct,
        total_coefficients,
    )
    from .logs import Log, load, load_database, load_vehicle
    from .tracing import TracedFlights, trace
    from .workspaces import Version, Workspace, open_workspace

__getattr__, __dir__, __all__ = attach(__name__, __file__)
