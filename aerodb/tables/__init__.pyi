from .algebra import cancel, plus, times
from .arguments import breakpoints_over, calls, channel_of, rebuilt
from .check_cases import CheckCase, failures, make_check_cases
from .consolidation import NodeShare, consolidate, node_lineage, plan, point_lineage
from .database import AeroDatabase, Prediction, Term, Variable
from .definitions import CONSTANTS, STATE_CHANNEL
from .differences import DatabaseDiff, NodeChanges, TermChange, diff
from .envelope import flown_envelope
from .evaluation import Evaluation, Place, evaluate_database
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
from .linear_terms import Site, sites
from .nodes import neutral_point, spread, table_grids
from .program import AnyTable, Program, compile_program, evaluate
from .reference import (
    HAT_RATES,
    WIND_AXES,
    Reference,
    body_to_wind,
    hat_rate,
    transfer_moments,
    wind_to_body,
)
from .scattered import ScatteredTable
from .slopes import QUANTITIES, new_increments, new_sign_changes
from .state_model import LAWS, Kirchhoff, Law, Relay, StateModel, slow_rate
from .table import EXTRAPOLATIONS, Table
from .uncertainty import EFFECTS, Bound, Uncertainty, bound_arrays

__all__ = [
    "BASE_VARIABLES",
    "COMPARISONS",
    "CONSTANTS",
    "EFFECTS",
    "EXTRAPOLATIONS",
    "FUNCTIONS",
    "HAT_RATES",
    "LAWS",
    "MAX_DEPTH",
    "MAX_LENGTH",
    "QUANTITIES",
    "STATE_CHANNEL",
    "WIND_AXES",
    "AeroDatabase",
    "AnyTable",
    "Bound",
    "Call",
    "CheckCase",
    "DatabaseDiff",
    "Evaluation",
    "Expression",
    "Increment",
    "Interval",
    "Kirchhoff",
    "Law",
    "Name",
    "Negation",
    "NodeChanges",
    "NodeShare",
    "Number",
    "Operation",
    "Place",
    "Prediction",
    "Program",
    "Reference",
    "RefinedShape",
    "Refit",
    "Relay",
    "ScatteredTable",
    "Site",
    "StateModel",
    "Table",
    "TableCall",
    "Term",
    "TermChange",
    "Uncertainty",
    "Value",
    "Variable",
    "body_to_wind",
    "bound_arrays",
    "breakpoints_over",
    "calls",
    "cancel",
    "channel_of",
    "compile_program",
    "consolidate",
    "diff",
    "evaluate",
    "evaluate_database",
    "failures",
    "flown_envelope",
    "hat_rate",
    "make_check_cases",
    "neutral_point",
    "new_increments",
    "new_sign_changes",
    "node_lineage",
    "number",
    "parse",
    "plan",
    "plus",
    "point_lineage",
    "rebuilt",
    "sites",
    "slow_rate",
    "spread",
    "table_grids",
    "times",
    "transfer_moments",
    "wind_to_body",
]
