"""JSBSim aircraft files: read and write.

`import_jsbsim` reads ``<metrics>`` and ``<aerodynamics>`` of a file into an AeroDatabase.
`export_jsbsim` writes a minimal aircraft with the same coefficients and the mass of a
`MassBalance`; `merge_jsbsim` puts it into an existing aircraft file. `jsbsim_check_cases` draws
check cases for it, and `check_in_jsbsim` compares JSBSim with the database at these cases;
`input_properties` names the JSBSim property of each input.

Reading: `xml_elements` parses the XML, `reader` builds the database, `functions`, `operations` and
`table` read functions and their tables, `axes` holds axes and frames.

Writing: `export` builds the file, `mass_balance` its mass, `writing` its functions and `elements`
its XML elements; `merge` joins it with an aircraft.

`properties` maps JSBSim properties to channels, both ways. `STALL_HYSTERESIS`,
`hysteresis_description` and `property_identifier` serve `aerodb.exchange.state_terms`.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
