"""Modes of a linear model, named by the states that take part in them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.simulation.linear_model import LATERAL, LONGITUDINAL, LinearModel
from aerodb.support import Array

#: A real part below this share of the largest eigenvalue is rounding.
_ROUNDING: Final = 1e-9
#: Oscillations in the plane of symmetry, and what they are called as two real roots.
_IN_PLANE: Final = ("short period", "phugoid")
_IN_PLACE_OF_AN_OSCILLATION: Final = ("short period, real root", "phugoid, real root")
_LATERAL_OSCILLATIONS: Final = ("Dutch roll", "lateral phugoid")
#: Lateral real roots, and what is neither.
_ROOTS: Final = ("roll", "spiral")
_DIRECTIONAL: Final = "Dutch roll, real root"
#: From this share on, the other motion belongs to the description of a mode.
_COUPLED: Final = 0.25
#: A share this close to a half belongs to both modes.
_MERGED: Final = 0.15
_SAME: Final = {"V": "u", "alpha": "w", "beta": "v"}


@dataclass(frozen=True)
class Mode:
    """A mode of motion.

    Parameters
    ----------
    name : ``short period``, ``phugoid``, ``Dutch roll``, ``roll``, ``spiral``, or what it is
        instead, such as ``lateral phugoid``.
    eigenvalue : [1/s]; of a pair the one with positive imaginary part.
    figures : ``omega`` [rad/s] and ``zeta`` (both of an oscillation), ``period``,
        ``time_constant`` (of a real root; negative where it grows) and ``time_to_half`` or
        ``time_to_double`` [s].
    standard_errors : of the figures, and of ``real`` and ``imaginary`` part.
    participation : state -> its share in the mode, sum 1.
    note : what the name does not say; may be empty.
    """

    name: str
    eigenvalue: complex
    figures: Mapping[str, float]
    standard_errors: Mapping[str, float]
    participation: Mapping[str, float]
    note: str = ""


def modes(model: LinearModel) -> tuple[Mode, ...]:
    """Return the modes of a linear model: longitudinal, lateral, then others, fastest first.

    Each is named by its participation factors, the products of the components of right and left
    eigenvector: they do not depend on the units of the states (Perez-Arriaga, Verghese & Schweppe,
    IEEE Trans. PAS-101, 1982). Of an oscillation in the plane of symmetry, w and q make the short
    period, u and theta the phugoid; of a lateral one, v makes the Dutch roll and phi the lateral
    phugoid (p and r take part in both). Of two lateral real roots with a Dutch roll, the one with
    more p is the roll mode, the other the spiral.
    """
    values, right = np.linalg.eig(model.A)
    left = np.linalg.pinv(right)
    largest = max(float(np.abs(values).max(initial=0.0)), 1e-300)
    found = []
    for k, value in enumerate(values):
        real = abs(value.imag) <= _ROUNDING * largest
        if not real and value.imag < 0:
            continue
        shares = np.abs(right[:, k] * left[k])
        shares = shares / shares.sum()
        participation = dict(zip(model.states, map(float, shares), strict=True))
        name, note = _named(participation, bool(real), value.real > 0)
        clean = complex(value.real, 0.0 if real else value.imag)
        errors = _errors(model, right[:, k], left[k], clean)
        found.append(Mode(name, clean, figures(clean), errors, participation, note))
    found = _counted(_roll_and_spiral(found))
    return tuple(sorted(found, key=lambda mode: (_order(mode), -abs(mode.eigenvalue))))


def figures(value: complex) -> dict[str, float]:
    """Figures of an eigenvalue, see `Mode`; infinite times for a neutral one.

    Times are in seconds, omega is in rad/s.
    """
    result: dict[str, float] = {}
    if value.imag:
        omega = abs(value)
        result = {
            "omega": omega, "zeta": -value.real / omega, "period": 2 * np.pi / abs(value.imag)
        }  # fmt: skip
    else:
        result["time_constant"] = -1.0 / value.real if value.real else float("inf")
    kind = "time_to_double" if value.real > 0 else "time_to_half"
    result[kind] = float(np.log(2.0) / abs(value.real)) if value.real else float("inf")
    return {name: float(number) for name, number in result.items()}


def _errors(model: LinearModel, right: Array, left: Array, value: complex) -> dict[str, float]:
    """Standard errors: the eigenvalue moves by ``left dA right``."""
    if model.A_slopes is None or model.covariance is None:
        return {}
    moved = np.einsum("i,ijp,j->p", left, model.A_slopes, right)
    if not value.imag:
        moved = moved.real + 0j
    size = abs(value)
    slopes = {"real": moved.real, "imaginary": moved.imag}
    if value.imag:
        slopes["omega"] = (value.real * moved.real + value.imag * moved.imag) / size
        slopes["zeta"] = -moved.real / size + value.real * slopes["omega"] / size**2
        slopes["period"] = -2 * np.pi / value.imag**2 * moved.imag
    elif value.real:
        slopes["time_constant"] = moved.real / value.real**2
    if value.real:
        kind = "time_to_double" if value.real > 0 else "time_to_half"
        slopes[kind] = np.log(2.0) / value.real**2 * moved.real
    return {
        name: float(np.sqrt(max(row @ model.covariance @ row, 0.0))) for name, row in slopes.items()
    }


def _named(participation: Mapping[str, float], real: bool, grows: bool) -> tuple[str, str]:
    """Name and note of a mode."""
    share = {_SAME.get(name, name): value for name, value in participation.items()}
    plane = sum(value for name, value in share.items() if name in LONGITUDINAL)
    lateral = sum(value for name, value in share.items() if name in LATERAL)
    further = {name: v for name, v in share.items() if name not in LONGITUDINAL | LATERAL}
    get = lambda *names: sum(share.get(name, 0.0) for name in names)  # noqa: E731
    if sum(further.values()) > max(plane, lateral):
        return f"state {max(further, key=lambda name: further[name])}", ""
    notes = []
    if plane >= lateral:
        fast = get("w", "q") >= get("u", "theta")
        place = 0 if fast else 1
        name = _IN_PLANE[place]
        if real:
            name = _IN_PLACE_OF_AN_OSCILLATION[place]
            notes.append("two real roots in place of an oscillation, or one merged with another")
        if abs(get("w", "q") - 0.5 * plane) < _MERGED * plane:
            notes.append("short period and phugoid have merged: both pairs of states take part")
    else:
        if real:
            shares = (get("p"), get("phi"), get("v", "r"))
            name = (*_ROOTS, _DIRECTIONAL)[int(np.argmax(shares))]
            if name == _DIRECTIONAL:
                notes.append("no oscillation: sideslip grows or dies out alone")
        else:
            name = _LATERAL_OSCILLATIONS[0 if get("v") >= get("phi") else 1]
            if name == _LATERAL_OSCILLATIONS[1]:
                notes.append("roll and spiral have merged into an oscillation")
    smaller = min(plane, lateral) / max(plane + lateral, 1e-300)
    if smaller > _COUPLED:
        other = "lateral" if plane >= lateral else "longitudinal"
        notes.append(f"coupled: {100 * smaller:.0f} % {other} motion")
    if grows:
        notes.append("unstable")
    return name, "; ".join(notes)


def _roll_and_spiral(found: list[Mode]) -> list[Mode]:
    """Beside one Dutch roll, two lateral real roots are roll and spiral: roll is where p takes the
    greater part."""
    names = [mode.name for mode in found]
    places = [k for k, name in enumerate(names) if name in (*_ROOTS, _DIRECTIONAL)]
    if names.count("Dutch roll") != 1 or len(places) != 2:
        return found
    places.sort(key=lambda k: -found[k].participation.get("p", 0.0))
    for k, name in zip(places, _ROOTS, strict=True):
        if found[k].name != name:
            own = "p" if name == "roll" else "phi"
            share = 100 * found[k].participation.get(own, 0.0)
            note = f"roll and spiral are mixed: {own} has {share:.0f} %"
            unstable = "unstable" * (found[k].eigenvalue.real > 0)
            found[k] = replace(found[k], name=name, note="; ".join(filter(None, (note, unstable))))
    return found


def _counted(found: list[Mode]) -> list[Mode]:
    """Modes of one name are told apart by a note, which says that there are several."""
    names = [mode.name for mode in found]
    result = []
    for mode in found:
        several = names.count(mode.name)
        if several == 1 or mode.name in (*_IN_PLACE_OF_AN_OSCILLATION, _DIRECTIONAL):
            result.append(mode)
            continue
        note = "; ".join(filter(None, (mode.note, f"one of {several} that move the same states")))
        result.append(replace(mode, note=note))
    return result


def _order(mode: Mode) -> int:
    """0 in the plane of symmetry, 1 lateral, 2 else."""
    if mode.name in (*_IN_PLANE, *_IN_PLACE_OF_AN_OSCILLATION):
        return 0
    return 1 if mode.name in (*_LATERAL_OSCILLATIONS, *_ROOTS, _DIRECTIONAL) else 2
