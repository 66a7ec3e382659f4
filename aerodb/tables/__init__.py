"""Aerodynamic databases: tables, expressions and increments, and what can be computed from them.

The way through:

1. `parse` reads an `Expression`; `Table` and `ScatteredTable` interpolate values. `Term`s over
   them, with a `Reference` geometry, `Variable`s, `StateModel`s and `Increment`s, make an
   `AeroDatabase`.
2. `AeroDatabase.predict` gives the six coefficients (`Prediction`); `evaluate_database` adds
   standard errors and places (`Evaluation`, `Place`).
3. `consolidate` folds increments into tables where that is exact; `plan_consolidation` tells
   where; `node_lineage` and `point_lineage` name the increments and flights behind a value.
4. `diff` compares two databases (`DatabaseDiff`); `slopes_by` gives derivatives along a flight,
   and `new_sign_changes` finds slopes whose sign changes outside the data; `make_check_cases` and
   `failed_check_cases` guard stored versions.

Modules, from the bottom up: `expression`, `functions`, `program` (compiled expressions); `table`,
`scattered`, `kernel` (interpolation); `reference`, `state_model`, `uncertainty`, `increment`;
`definitions` and `database`; `arguments`, `linear_terms`, `nodes`, `envelope` (where tables are
called, and where flights have been); `consolidation`, `differences`, `evaluation`, `sensitivity`,
`slopes`, `check_cases`.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
