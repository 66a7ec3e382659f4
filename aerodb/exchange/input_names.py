"""Names of inputs that are no channels: as the file writes them, and which channel they may be."""

import re
from collections.abc import Collection
from typing import Final

from aerodb.errors import InputError
from aerodb.exchange.binding_units import in_unit
from aerodb.exchange.daveml import described_unit, read_unit
from aerodb.exchange.jsbsim import described_property, property_unit
from aerodb.nomenclature import channel
from aerodb.tables import Name
from aerodb.units import conversion

#: Words of names that say nothing about which quantity it is.
_EMPTY: Final = {"delta", "deflection", "position", "pos", "norm", "rad", "deg", "fcs", "cmd"}


def written_name(name: str, description: str) -> str:
    """Return the name under which the file knows a free input.

    >>> written_name("fcs_flap_pos_norm", "JSBSim property fcs/flap-pos-norm")
    'fcs/flap-pos-norm'
    """
    return described_property(description) or name


def propose_bindings(name: str, description: str, channels: Collection[str]) -> tuple[str, ...]:
    """Return expressions that may be meant for a free input: those of channels whose words its
    name contains, the closest first, and zero.

    description : of the free input, with the unit that its file states. channels : to choose from.
    A unit that is not known raises no error: it gives no scale.

    >>> propose_bindings("gear", "landing gear [deg, positive ext]", ["delta_landing_gear"])
    ('0',)
    >>> propose_bindings("rudderPosition", "rudder [deg, positive tel]", ["delta_rudder", "beta"])
    ('delta_rudder*57.29577951308232', '0')
    """
    written = written_name(name, description)
    stated = described_unit(description)
    unit = property_unit(written) if stated is None else read_unit(stated)
    words = _words(written)
    fitting = []
    for each in channels:
        own = _words(each)
        if own and own <= words:
            scale = _scale(each, unit)
            if scale is not None:
                fitting.append((len(words - own), each, str(in_unit(Name(each), scale))))
    return (*(text for _, _, text in sorted(fitting)), "0")


def _words(name: str) -> set[str]:
    parts = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    return {word for word in re.split(r"[^a-z0-9]+", parts) if len(word) > 1} - _EMPTY


def _scale(name: str, unit: str) -> float | None:
    """Scale from a channel to a unit; None where it is of another dimension, or unknown."""
    own = channel(name).unit
    if (own in ("", "1")) != (unit in ("", "1")):  # a share of the travel is no angle
        return None
    try:
        scale, offset = conversion(own, unit)
    except InputError:
        return None
    return None if offset else scale
