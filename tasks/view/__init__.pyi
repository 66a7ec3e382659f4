from .channels import (
    FEWEST_POINTS,
    MOST_POINTS,
    Series,
    envelopes_of,
    pair_of,
    record_of,
    series_of,
    track_of,
)
from .evaluation import MOST_LINE_POINTS, database_of, evaluate_at, sweep
from .finding_documents import finding_document, findings_page, labels_of, reference_of
from .flight_documents import damage_document, flight_details, flights_document
from .json_documents import as_json
from .lineage_documents import (
    compare_versions,
    impact_document,
    lineage_document,
    origins_document,
    prov_of,
    rebuilds,
)
from .log_documents import has_log_here, log_document, logged_series, topics_document
from .online_estimates import online_estimates
from .status import status_of
from .table_documents import table_document
from .trimming import (
    SteadyFlight,
    expansion_document,
    glides,
    modes_document,
    sweep_document,
    sweep_value,
    trim_document,
    trim_of,
)
from .version_documents import (
    findings_words,
    flights_words,
    held_out_words,
    history_document,
    matching,
    notes_document,
    version_details,
    versions_document,
)

__all__ = [
    "FEWEST_POINTS",
    "MOST_LINE_POINTS",
    "MOST_POINTS",
    "Series",
    "SteadyFlight",
    "as_json",
    "compare_versions",
    "damage_document",
    "database_of",
    "envelopes_of",
    "evaluate_at",
    "expansion_document",
    "finding_document",
    "findings_page",
    "findings_words",
    "flight_details",
    "flights_document",
    "flights_words",
    "glides",
    "has_log_here",
    "held_out_words",
    "history_document",
    "impact_document",
    "labels_of",
    "lineage_document",
    "log_document",
    "logged_series",
    "matching",
    "modes_document",
    "notes_document",
    "online_estimates",
    "origins_document",
    "pair_of",
    "prov_of",
    "rebuilds",
    "record_of",
    "reference_of",
    "series_of",
    "status_of",
    "sweep",
    "sweep_document",
    "sweep_value",
    "table_document",
    "topics_document",
    "track_of",
    "trim_document",
    "trim_of",
    "version_details",
    "versions_document",
]
