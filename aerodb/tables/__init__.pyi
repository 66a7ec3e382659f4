from .algebra import cancel, plus, times
from .arguments import breakpoints_over, channel_of, rebuilt, scattered_over, table_calls
from .check_cases import CheckCase, failed_check_cases, make_check_cases
from .consolidation import NodeShare, consolidate, node_lineage, plan_consolidation, point_lineage
from .database import AeroDatabase, Prediction, Term, Variable
from .definitions import CONSTANTS, LIFT_INCREMENTS, STATE_CHANNEL
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
from .instructions import Instructions, Machine
from .linear_terms import LinearTable, linear_tables
from .machine import execute
from .nodes import neutral_point, table_grids, vary
from .program import AnyTable, Program, compile_program, evaluate
from .reference import (
    HAT_RATES,
    INCREMENT_AXES,
    WIND_AXES,
    Reference,
    body_to_wind,
    hat_rate,
    transfer_moments,
    wind_to_body,
)
from .scattered import ScatteredTable
from .sensitivity import slopes_by, slopes_by_lift
from .slopes import QUANTITIES, new_increments, new_sign_changes
from .state_model import LAWS, Kirchhoff, Law, Relay, StateModel, slow_rate
from .table import EXTRAPOLATIONS, Table
from .total import TotalCoefficients, total_coefficients
from .uncertainty import EFFECTS, Bound, Uncertainty, bound_arrays

__all__ = [
    "BASE_VARIABLES",
    "COMPARISONS",
    "CONSTANTS",
    "EFFECTS",
    "EXTRAPOLATIONS",
    "FUNCTIONS",
    "HAT_RATES",
    "INCREMENT_AXES",
    "LAWS",
    "LIFT_INCREMENTS",
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
    "Instructions",
    "Interval",
    "Kirchhoff",
    "Law",
    "LinearTable",
    "Machine",
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
    "StateModel",
    "Table",
    "TableCall",
    "Term",
    "TermChange",
    "TotalCoefficients",
    "Uncertainty",
    "Value",
    "Variable",
    "body_to_wind",
    "bound_arrays",
    "breakpoints_over",
    "cancel",
    "channel_of",
    "compile_program",
    "consolidate",
    "diff",
    "evaluate",
    "evaluate_database",
    "execute",
    "failed_check_cases",
    "flown_envelope",
    "hat_rate",
    "linear_tables",
    "make_check_cases",
    "neutral_point",
    "new_increments",
    "new_sign_changes",
    "node_lineage",
    "number",
    "parse",
    "plan_consolidation",
    "plus",
    "point_lineage",
    "rebuilt",
    "scattered_over",
    "slopes_by",
    "slopes_by_lift",
    "slow_rate",
    "table_calls",
    "table_grids",
    "times",
    "total_coefficients",
    "transfer_moments",
    "vary",
    "wind_to_body",
]
