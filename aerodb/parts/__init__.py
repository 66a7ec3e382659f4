"""Parts of an aircraft: each entry of a build-up becomes variables and loads of a database.

A part is stored as it is written (``[parts.NAME]`` with a ``kind``). `expand` turns it into
`aerodb.tables.Variable`s and load `Term`s; a part computes nothing by itself.

Kind (module)   What it is
--------------  -----------------------------------------------------------------
section         strip of a lifting surface
surface         lifting surface of several strips, with control regions of its span
fuselage        body with area, length and volume
engine          thrust along a line, with its slipstream by momentum theory
rotor           thrust, drag and moments of a propeller over its advance ratio
leg             wheel of the landing gear: spring, damping, rolling and side force
body            any loads, in axes of the part
wake            vortex pair of another aircraft, which the other parts feel

`frame` holds place and axes of a part, the velocity there, and how its loads act on the aircraft;
`entry` the keys that all kinds share; `writing` the expressions of one part.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .expand import KINDS, Expansion, expand, felt_at_places, rotors_of
    from .leg import STANDING, contact_points
    from .rotor import beyond_tilt, command_ranges
    from .section import flap_effectiveness

__getattr__, __dir__, __all__ = attach(__name__, __file__)
