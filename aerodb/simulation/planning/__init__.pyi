from .envelope_expansion import Expansion, Growth, Margins, expand_envelope
from .experiment import DesignedManoeuvre, design_manoeuvre, expected_noise, manoeuvre_text

__all__ = [
    "DesignedManoeuvre",
    "Expansion",
    "Growth",
    "Margins",
    "design_manoeuvre",
    "expand_envelope",
    "expected_noise",
    "manoeuvre_text",
]
