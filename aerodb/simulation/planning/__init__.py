"""What to fly next: manoeuvres that determine parameters best, and steps to a wider envelope.

`design_manoeuvre` finds the manoeuvre, within limits, that determines parameters best
(`experiment`); `envelope_expansion` orders the test points on the way to a wider envelope.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .envelope_expansion import Expansion, Growth, Margins, expand_envelope
    from .experiment import DesignedManoeuvre, design_manoeuvre, expected_noise, manoeuvre_text

__getattr__, __dir__, __all__ = attach(__name__, __file__)
