"""DAVE-ML 2.0 (AIAA S-119): read and write.

`import_daveml` reads a file into an AeroDatabase; `export_daveml` writes one and verifies the
file's own check cases before it returns it; `is_daveml` recognises the format.

Reading: `root_element` parses the XML, `reader` walks its elements, `tables` reads tables and
uncertainties, `mathml` reads calculations, `names` maps standard names, units and signs to
channels and axes, and `model` builds the database.

Writing: `export` decides what the file contains, `document` builds its elements and `writing` its
calculations. `check_cases` reads static shots and verifies a database against them.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .check_cases import SignalEvaluator, read_check_cases, verify_cases
    from .export import export_daveml
    from .names import described_unit, read_unit
    from .reader import import_daveml
    from .root_element import is_daveml

__getattr__, __dir__, __all__ = attach(__name__, __file__)
