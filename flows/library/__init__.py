"""The library: what ``import aerodb`` gives a Python user, as plain functions and frozen results.

The way through, without a workspace:

1. `load` reads a log in a confined process, maps it and conditions it: a `Log`.
2. `reconstruct` makes it consistent: a `ReconstructedFlight` with sensor errors and a verdict.
3. `total_coefficients` gives `MeasuredCoefficients`; `compare` puts them beside a database, which
   `load_database` reads: a `ComparedFlight`.
4. `trace` names what the residuals of several flights have in common: `TracedFlights`, with a
   candidate database. `update` adds declared increments: an `UpdatedDatabase`. `validate` flies a
   database over their manoeuvres: a `ValidatedDatabase`. `fit` estimates a declared model by any
   method: a `FittedModel`.
5. `evaluate` gives the coefficients of a database at points: `EvaluatedPoints`.

`open_workspace` reads what the commands have stored, and `Client` what a console serves.

Every result says its verdict when it is printed, and has `report` (text), `plot`, `to_pandas`,
`to_xarray`, `save` (`load_result` reads it back), and is shown as a table in a notebook. The errors
that are raised (`AeroError` and those below it) are names of `aerodb` too.
They call the functions of the science packages that the commands call; nothing is computed here.

Modules: `views` (text, HTML, pandas, xarray), `plots`, `saving`, `logs`, `flights`, `tracing`,
`updating`, `validating`, `fitting`, `evaluation`, `documents`, `workspaces`, `client`.
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
    from .saving import SavedResult, load_result
    from .tracing import TracedFlights, trace
    from .updating import UpdatedDatabase, update
    from .validating import ValidatedDatabase, validate
    from .workspaces import Version, Workspace, open_workspace

__getattr__, __dir__, __all__ = attach(__name__, __file__)
