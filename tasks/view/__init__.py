"""Read-only documents: what the commands print with ``--json`` and the console's API returns.

Flights: `flights_document`, `flight_details`; `record_of` and `series_of` give channels for plots.
Versions: `versions_document`, `version_details`, `history_document`, `table_document`;
`evaluate_at` and `sweep` evaluate one. Lineage: `lineage_document`, `origins_document`,
`impact_document`, `compare_versions`, `rebuilds`, `prov_of`. Findings: `findings_page`,
`finding_document`. Operation: `status_of`. `as_json` writes a document as text.

Nothing here computes or stores a result.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
