from . import page
from .decimation import decimated, extremes, flagged_stretches
from .diff_documents import diff_document
from .diff_figures import diff_figure
from .document import (
    add_remarks,
    beyond_remarks,
    hold_out_remarks,
    left_out_remarks,
    update_document,
)
from .estimates_page import estimates_report
from .findings import meaning
from .fit_report import fit_report
from .flight_page import FlightStory, flight_report
from .glossary import advice_words, channel_words, effect_words, hypothesis_words, in_words
from .head import Head
from .headlines import error_rows, excluded_sizes, headline, what_stayed
from .lineage_figure import Relative, lineage_graph
from .loop_documents import loop_document, rival_remarks, stall_remarks
from .numbers import for_people
from .page import pdf, render
from .response_page import FlownStretch, response_report
from .style import FLAGGED, FLIGHT, MEASURED, UPDATED, channel_scale, visible
from .terms import derivative_unit, sensor_error_unit, term_name, term_unit
from .update_page import UpdateStory, update_report
from .version_page import NameMove, UsedFlight, VersionStory, version_report

__all__ = [
    "FLAGGED",
    "FLIGHT",
    "MEASURED",
    "UPDATED",
    "FlightStory",
    "FlownStretch",
    "Head",
    "NameMove",
    "Relative",
    "UpdateStory",
    "UsedFlight",
    "VersionStory",
    "add_remarks",
    "advice_words",
    "beyond_remarks",
    "channel_scale",
    "channel_words",
    "decimated",
    "derivative_unit",
    "diff_document",
    "diff_figure",
    "effect_words",
    "error_rows",
    "estimates_report",
    "excluded_sizes",
    "extremes",
    "fit_report",
    "flagged_stretches",
    "flight_report",
    "for_people",
    "headline",
    "hold_out_remarks",
    "hypothesis_words",
    "in_words",
    "left_out_remarks",
    "lineage_graph",
    "loop_document",
    "meaning",
    "page",
    "pdf",
    "render",
    "response_report",
    "rival_remarks",
    "sensor_error_unit",
    "stall_remarks",
    "term_name",
    "term_unit",
    "update_document",
    "update_report",
    "version_report",
    "visible",
    "what_stayed",
]
