"""Reports: self-contained HTML pages (and PDF) of flights, updates and versions, and their JSON.

1. `update_document` and `loop_document` give the JSON of an update or a closed loop; `headline`
   sums it up in one sentence; `diff_document` gives the JSON of a diff of two versions.
2. `flight_report`, `update_report` and `version_report` render a page from a `FlightStory`,
   `UpdateStory` or `VersionStory`; `pdf` converts a page.

Modules: `flight_page`, `update_page`, `version_page` (pages), with the templates in templates/ and
the engine in `page`; `document`, `loop_documents`, `diff_documents` (JSON); `headlines` (sentences
and error tables); `glossary`, `terms`, `numbers` (names of effects, channels and terms, numbers and
units: everything that is shown uses these); `findings` (findings in words); `head` (where a result
comes from); `flight_figures`, `figures`, `update_figures`, `database_figure`, `diff_figures`,
`lineage_figure` (figures); `style` (colours, units, names as text); `decimation` (long records with
fewer points); `flight_errors` (errors of single flights).
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
