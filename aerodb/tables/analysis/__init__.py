"""Computed from a database: standard errors, differences, consolidation, slopes, check cases.

`arguments`, `linear_terms`, `nodes` and `envelope` find where tables are called, and where flights
have been. `evaluation` gives coefficients with standard errors and places (`declared_uncertainty`).
`consolidation` folds increments into tables (`multilinear`, `node_increment`). `differences`
compares databases; `sensitivity` gives derivatives along a flight, `slopes` their sign changes, and
`check_cases` guards stored versions. `lacking_effects` says what a database does not know, and
gives its curves, `unusual_content` what no aircraft has, `height_tables` what no ground effect has.
`tabulation` makes tables of a database.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .arguments import breakpoints_over, channel_of, rebuilt, scattered_over, table_calls
    from .check_cases import CheckCase, failed_check_cases, make_check_cases
    from .consolidation import (
        NodeShare,
        consolidate,
        node_lineage,
        plan_consolidation,
        point_lineage,
    )
    from .differences import DatabaseDiff, NodeChanges, TermChange, diff
    from .envelope import continued, flown_envelope
    from .evaluation import Evaluation, Place, evaluate_database
    from .height_tables import uneven_height_tables
    from .lacking_effects import curves, lacking_effects
    from .linear_terms import LinearTable, depends_on, linear_tables
    from .nodes import table_grids, vary
    from .parameter_estimates import (
        parameter_covariance,
        with_estimated_parameters,
        with_parameter_covariance,
    )
    from .sensitivity import (
        ends_about,
        parameter_inside,
        slopes_along,
        slopes_by,
        slopes_by_lift,
        slopes_by_parameter,
        with_own_states,
        with_parameters,
    )
    from .slices import Slice, acts_on, changed_parameters, slice_over, slices
    from .slopes import QUANTITIES, new_increments, new_sign_changes
    from .tabulation import Tabulation, tabulate
    from .unstated_inputs import (
        STAND_IN_SPEED,
        height_outside_ground_effect,
        neutral_point,
        unstated_inputs,
    )
    from .unusual_content import unusual_content

__getattr__, __dir__, __all__ = attach(__name__, __file__)
