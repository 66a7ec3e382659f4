"""Aerodynamic databases: tables, expressions and increments, and what can be computed from them.

The way through:

1. `parse` reads an `Expression`; `Table` and `ScatteredTable` interpolate values. `Term`s over
   them, with a `ReferenceGeometry` geometry, `Variable`s, `StateModel`s and `Increment`s, make an
   `AeroDatabase`.
2. `AeroDatabase.predict` gives the six coefficients (`Prediction`); `evaluate_database` adds
   standard errors and places (`Evaluation`, `Place`).
3. `consolidate` folds increments into tables where that is exact; `plan_consolidation` tells
   where; `node_lineage` and `point_lineage` name the increments and flights behind a value.
4. `diff` compares two databases (`DatabaseDiff`); `slopes_by` gives derivatives along a flight,
   and `new_sign_changes` finds slopes whose sign changes outside the data; `make_check_cases` and
   `failed_check_cases` guard stored versions.

Modules, from the bottom up: `expression`, `functions`, `program` (compiled expressions); `table`,
`scattered`, `kernel` (interpolation); `reference`, `rate_state`, `state_model`, `uncertainty`,
`increment`; `loads`, `prediction`, `definitions` and `database`. Package: `analysis`, what is
computed from databases.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .algebra import cancel, plus, substituted, times
    from .analysis import (
        QUANTITIES,
        STAND_IN_SPEED,
        CheckCase,
        DatabaseDiff,
        Evaluation,
        LinearTable,
        NodeChanges,
        NodeShare,
        Place,
        Slice,
        Tabulation,
        TermChange,
        acts_on,
        breakpoints_over,
        changed_parameters,
        channel_of,
        consolidate,
        continued,
        curves,
        depends_on,
        diff,
        ends_about,
        evaluate_database,
        failed_check_cases,
        flown_envelope,
        height_outside_ground_effect,
        lacking_effects,
        linear_tables,
        make_check_cases,
        neutral_point,
        new_increments,
        new_sign_changes,
        node_lineage,
        parameter_covariance,
        parameter_inside,
        plan_consolidation,
        point_lineage,
        rebuilt,
        scattered_over,
        slice_over,
        slices,
        slopes_along,
        slopes_by,
        slopes_by_lift,
        slopes_by_parameter,
        table_calls,
        table_grids,
        tabulate,
        uneven_height_tables,
        unstated_inputs,
        unusual_content,
        vary,
        with_estimated_parameters,
        with_own_states,
        with_parameter_covariance,
        with_parameters,
    )
    from .database import AeroDatabase, Term, Variable
    from .definitions import CONSTANTS, LIFT_INCREMENTS, STATE_CHANNEL, value_of
    from .expression import (
        MAX_DEPTH,
        MAX_LENGTH,
        Call,
        Expression,
        Name,
        Negation,
        Number,
        Operation,
        TableCall,
        number,
        parse,
    )
    from .functions import COMPARISONS, FUNCTIONS, Value
    from .increment import BASE_VARIABLES, Increment, Interval, RefinedShape, Refit
    from .instructions import Instructions, Machine
    from .loads import (
        LOAD_AXES,
        as_coefficient,
        coefficient_axis,
        load_axis,
        load_shares,
        scale_of,
        summed,
    )
    from .machine import execute
    from .parameter import Parameter, covariance_of, normal, sigma_of
    from .prediction import Prediction
    from .program import AnyTable, Program, compile_program, evaluate
    from .rate_state import Rate
    from .reference import (
        HAT_RATES,
        INCREMENT_AXES,
        STILL_AIR,
        WIND_AXES,
        ReferenceGeometry,
        body_to_wind,
        hat_rate,
        transfer_moments,
        wind_to_body,
    )
    from .scattered import ScatteredTable
    from .state_kernel import relaxed
    from .state_model import LAWS, Kirchhoff, Law, Relay, StateModel, slow_rate
    from .table import EXTRAPOLATIONS, Table
    from .total import TotalCoefficients, total_coefficients
    from .uncertainty import EFFECTS, Bound, Uncertainty, bound_arrays

__getattr__, __dir__, __all__ = attach(__name__, __file__)
