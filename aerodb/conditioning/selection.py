"""Samples of a flight that a user selects: by time, by the value of a channel, by phase."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.flight import Flight
from aerodb.nomenclature import channel
from aerodb.support import Array, Mask
from aerodb.units import quantity

_FORM = re.compile(r"\s*([A-Za-z]\w*)\s*(<=|>=|!=|<|>|=)\s*(\S.*?)\s*", re.ASCII)
_COMPARED: Final[Mapping[str, Callable[[Array, float], Mask]]] = {
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
}
_EXAMPLES = (
    'write "time > 10 s", "command_1 > 0.3", "height_above_ground >= 2 m" or "phase = hover"'
)


def selected(flight: Flight, conditions: Sequence[str]) -> Mask:
    """Return the samples (n,) of a flight for which all conditions hold.

    A condition compares a channel with a value in its unit, or `time` [s] from the first sample, or
    says of which kind of segment a sample is (`phase`). Raises InputError for another form, an
    unknown channel or kind of segment, or where no sample is left.

    >>> time = np.arange(5.0)
    >>> flight = Flight("f", "v", time, {"V": 10.0 * time})
    >>> selected(flight, ["V > 15 m/s", "time < 4"]).tolist()
    [False, False, True, True, False]
    """
    mask = np.ones(len(flight.time), dtype=np.bool_)
    for condition in conditions:
        mask &= _one(flight, condition)
    if not mask.any():
        raise InputError(
            f"no sample is selected by {' and '.join(conditions)}",
            f"flight {flight.id[:12]}",
            "widen the conditions, or leave this flight out with --flights",
        )
    return mask


def checked_conditions(conditions: Sequence[str]) -> tuple[str, ...]:
    """Return conditions without superfluous spaces; InputError for one that `selected` cannot
    read."""
    return tuple(" ".join(_parts(condition)) for condition in conditions)


def _parts(condition: str) -> tuple[str, str, str]:
    form = _FORM.fullmatch(condition)
    if form is None or (form[1] == "phase") != (form[2] in ("=", "!=")):
        raise InputError(f"'{condition}' is no condition", "--select", _EXAMPLES)
    if form[1] == "time":
        quantity(_number(form[3]), "s")
    elif form[1] != "phase":
        quantity(_number(form[3]), channel(form[1]).unit)
    return form[1], form[2], " ".join(form[3].split())


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _one(flight: Flight, condition: str) -> Mask:
    name, sign, value = _parts(condition)
    if name == "phase":
        return _phase(flight, value, sign == "=")
    if name == "time":
        return _COMPARED[sign](flight.time - flight.time[0], quantity(_number(value), "s"))
    good = np.isfinite(flight[name])
    return good & _COMPARED[sign](flight[name], quantity(_number(value), channel(name).unit))


def _phase(flight: Flight, kind: str, inside: bool) -> Mask:
    from aerodb.conditioning.segmentation import segments  # slow to import

    found = segments(flight)
    kinds = dict.fromkeys(each.kind for each in found)
    if inside and kind not in kinds:
        raise InputError(
            f"no segment of kind '{kind}'", f"flight {flight.id[:12]}", nearest(kind, kinds)
        )
    mask = np.zeros(len(flight.time), dtype=np.bool_)
    for each in found:
        if each.kind == kind:
            mask |= (flight.time >= each.start) & (flight.time <= each.end)
    return mask if inside else ~mask
