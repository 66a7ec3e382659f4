"""Read-only documents: what the commands print with ``--json`` and the console's API returns.

Flights: `flights_document`, `flight_details`; `record_of` and `series_of` give channels for plots.
Versions: `versions_document`, `version_details`, `history_document`, `table_document`, `waiting`;
`evaluate_at` and `sweep` evaluate one; `trim_changes` says what one changes for the pilot. Lineage:
`lineage_document`, `origins_document`, `impact_document`, `compare_versions`, `draw_differences`,
`rebuilds`, `prov_of`. Findings: `findings_page`, `finding_document`. Logs: `inspected_log`,
`logs_page`, `drafted_mapping`. Operation: `status_of`. `as_json` writes a document as text.

Nothing here computes or stores a result.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .backing_out import back_out_document
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
    from .evaluation import (
        MOST_LINE_POINTS,
        TAKEN,
        database_of,
        evaluate_at,
        outside_envelope,
        sweep,
    )
    from .finding_documents import finding_document, findings_page, labels_of, reference_of
    from .flight_documents import (
        damage_document,
        flight_details,
        flight_document,
        flights_document,
        roll_command,
        step_words,
    )
    from .json_documents import as_json
    from .lineage_documents import (
        compare_versions,
        draw_differences,
        impact_document,
        origins_document,
        prov_of,
        rebuilds,
    )
    from .log_documents import (
        has_log_here,
        log_document,
        logged_series,
        recording_document,
        topics_document,
    )
    from .log_inspection import (
        LogsPage,
        inspected_log,
        inspection_lines,
        inspection_verdict,
        logs_page,
    )
    from .mapping_drafts import drafted_mapping
    from .mode_documents import modes_part
    from .modes_beside_flights import flown_modes, modes_beside_flights
    from .online_estimates import online_estimates
    from .status import status_of
    from .table_documents import table_document
    from .trim_changes import trim_changes
    from .trimming import (
        StatedCondition,
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
        lineage_document,
        matching,
        notes_document,
        version_details,
        versions_document,
        waiting,
    )

__getattr__, __dir__, __all__ = attach(__name__, __file__)
