"""JSBSim aircraft files: read and write.

`import_jsbsim` reads ``<metrics>`` and ``<aerodynamics>`` of a file into an AeroDatabase.
`export_jsbsim` writes a minimal aircraft with the same coefficients and the mass of a
`MassBalance`; `merge_jsbsim` puts it into an existing aircraft file. `jsbsim_check_cases` draws
check cases for it, and `check_in_jsbsim` compares JSBSim with the database at these cases;
`input_properties` names the JSBSim property of each input.

Reading: `metrics` parses the XML, `reader` builds the database, `functions`, `operations` and
`table` read functions and their tables, `axes` holds axes and frames.

Writing: `export` builds the file, `mass_balance` its mass, `writing` its functions and `elements`
its XML elements; `merge` joins it with an aircraft.

`properties` maps JSBSim properties to channels, both ways; `states` runs relays and states with
memory.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .check_cases import JsbsimAgreement, check_in_jsbsim, jsbsim_check_cases, read_jsbsim_cases
    from .export import export_jsbsim, input_properties
    from .mass_balance import MassBalance, mass_balance_of
    from .merge import merge_jsbsim
    from .properties import described_property, property_expression, property_unit
    from .reader import import_jsbsim
    from .states import states_for_jsbsim

__getattr__, __dir__, __all__ = attach(__name__, __file__)
