"""Reports: self-contained HTML pages (and PDF) of flights, updates and versions, and their JSON.

1. `update_document` and `loop_document` give the JSON of an update or a closed loop, and
   `decision` the lines to decide on; `diff_document` gives the JSON of a diff of two versions.
2. `flight_report`, `update_report` and `version_report` render a page from a `FlightStory`,
   `UpdateStory` or `VersionStory`, `log_report` one of logs without a vehicle from `LogStory`s;
   `pdf` converts a page.

Modules: `flight_page`, `log_page`, `update_page`, `version_page` (pages), with the templates in
templates/ and the engine in `page`; `document`, `loop_documents`, `diff_documents` (JSON);
`decision` (five lines to decide on), `gate_lines` (what to decide a release on), `qualification`
(the table for a QTG), `mode_table` (modes beside those of flights), `error_table`
(errors per axis); `glossary`, `terms`, `numbers`
(names of effects, channels and terms, numbers and units: everything that is shown uses these);
`findings` (findings in words); `head` (where a result comes from); `flight_figures`, `figures`,
`update_figures`, `database_figure`, `diff_figures`, `front_figure`, `lineage_figure` (figures);
`reach` (where data end); `style` (colours); `labels` (names as text); `decimation` (long records
with fewer points); `flight_errors` (errors of single flights).
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from . import page
    from .decimation import decimated, extremes, flagged_stretches
    from .decision import Decision, decision, sized_finding
    from .diff_documents import (
        curve_document,
        diff_document,
        edits_of,
        faded_at,
        parameter_changes,
        parameter_row,
    )
    from .diff_figures import diff_figure
    from .document import (
        add_remarks,
        beyond_remarks,
        hold_out_remarks,
        left_out_remarks,
        update_document,
    )
    from .error_table import error_rows, excluded_sizes, shown_axes
    from .estimates_page import estimates_report
    from .findings import finding_sentence, meaning
    from .fit_report import fit_report
    from .flight_page import FlightStory, flight_report
    from .gate_lines import (
        count_passed,
        count_within,
        derivative_words,
        gate_rows,
        release_lines,
        version_lines,
    )
    from .glossary import (
        advice_words,
        capital,
        channel_words,
        effect_words,
        hypothesis_words,
        in_words,
        listed,
        parameter_name,
        reasons_in_units,
        rejected,
    )
    from .head import Head
    from .held_or_free import held_or_free_words
    from .labels import channel_scale, visible
    from .lineage_figure import Graph, Relative, lineage_graph
    from .log_page import MOST_LOGS, LogStory, log_report, script_source
    from .loop_documents import loop_document, rival_remarks, stall_remarks
    from .mode_table import COMPARED, mode_table, mode_words
    from .next_command import accepting, measurements, measuring
    from .numbers import change, display_unit, for_people
    from .page import pdf, render
    from .qualification import closed_words, feedback_lines, qualification_csv, uncovered_numbers
    from .reach import beyond_data, beyond_words, reach_of
    from .response_page import FlownStretch, response_report
    from .style import FLAGGED, FLIGHT, MEASURED, PAGE_WIDTH, PHONE_WIDTH, UPDATED
    from .terms import derivative_unit, increment_terms, sensor_error_unit, term_name, term_unit
    from .update_page import UpdateStory, update_report
    from .version_page import NameMove, UsedFlight, VersionStory, version_report

__getattr__, __dir__, __all__ = attach(__name__, __file__)
