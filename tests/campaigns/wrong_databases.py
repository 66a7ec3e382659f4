"""Wrong databases: what is exchanged, reversed or in another unit when a file of aerodynamics is
written, each a function of a right pair of a flight and its vehicle's database.

A kind counts for a database if it changes what it predicts at small angles by a tenth of what its
axis does there.
"""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from aerodb.errors import InputError
from aerodb.tables import parse, slopes_by
from aerodb.tables.analysis.lacking_effects import small_angles
from aerodb.tables.database import AeroDatabase, Term
from tests.campaigns.corruptions import FOOT, Corruption, Pair

#: Axes, also as loads of a file in body axes.
AXES: Mapping[str, tuple[str, ...]] = {
    "drag": ("C_drag", "CX", "FX"),
    "side": ("C_side", "CY", "FY"),
    "lift": ("C_lift", "CZ", "FZ"),
    "roll": ("Cl", "MX"),
    "pitch": ("Cm", "MY"),
    "yaw": ("Cn", "MZ"),
}
#: The dimensionless rate of a rate.
HATS: Mapping[str, str] = {"p": "p_hat", "q": "q_hat", "r": "r_hat"}
_PROBED = ("alpha", "beta", "p", "q", "r", "delta_elevator", "delta_aileron", "delta_rudder")


def _slopes(database: AeroDatabase) -> dict[tuple[str, str], float]:
    channels, found = small_angles(database, database.inputs), {}
    for name in _PROBED:
        if name in database.inputs:
            for axis, values in slopes_by(database, name, channels).items():
                found[axis, name] = float(np.mean(values))
    return found


def _differs(one: AeroDatabase, other: AeroDatabase) -> bool:
    """Whether a slope differs by a tenth of itself, or a constant by as much of the drag."""
    before, after = _slopes(one), _slopes(other)
    return any(
        abs(after.get(key, 0.0) - value) > 0.1 * abs(value) for key, value in before.items()
    ) or any(abs(value) > 1e-6 for key, value in after.items() if key not in before)


def _terms(change: Callable[[Term], Term | None], always: bool = False) -> Corruption:
    """Every term changed, or left out where there is None."""

    def corrupt(pair: Pair) -> Pair | None:
        right = pair.database
        if right is None:
            return None
        made = tuple(t for each in right.terms if (t := change(each)) is not None)
        if made == right.terms:
            return None
        try:
            database = replace(right, terms=made)
            changed = always or _differs(right, database)
        except (InputError, ValueError):
            return None
        return replace(pair, database=database) if changed else None

    return corrupt


def _scaled(axes: Collection[str], factor: str) -> Corruption:
    def change(term: Term) -> Term:
        if term.axis not in axes:
            return term
        return replace(term, expression=parse(f"{factor}*({term.expression})"))

    return _terms(change, always=True)


def _of(names: Collection[str], factor: str, axes: Collection[str] = ()) -> Corruption:
    """Variables times a factor wherever the file uses them, variables of its own among them; of
    certain axes, in their terms alone."""
    word = re.compile(rf"\b({'|'.join(map(re.escape, names))})\b")

    def put(text: str) -> str:
        return word.sub(lambda found: f"({factor}*{found.group()})", text)

    def corrupt(pair: Pair) -> Pair | None:
        right = pair.database
        if right is None:
            return None
        try:
            terms = tuple(
                replace(t, expression=parse(put(str(t.expression))))
                if not axes or t.axis in axes
                else t
                for t in right.terms
            )
            variables = {
                name: replace(v, expression=parse(put(str(v.expression))))
                if not axes and name not in names and v.expression is not None
                else v
                for name, v in right.variables.items()
            }
            database = replace(right, terms=terms, variables=variables)
            return replace(pair, database=database) if _differs(right, database) else None
        except (InputError, ValueError):
            return None

    return corrupt


def _exchanged(one: str, other: str) -> Corruption:
    to = dict(zip(AXES[one], AXES[other], strict=False))
    to |= dict(zip(AXES[other], AXES[one], strict=False))
    return _terms(lambda term: replace(term, axis=to.get(term.axis, term.axis)))


def _exchanged_names(one: str, other: str) -> Corruption:
    """Two variables exchanged in all terms."""
    word, to = re.compile(rf"\b({one}|{other})\b"), {one: other, other: one}

    def change(term: Term) -> Term:
        text = word.sub(lambda found: to[found.group()], str(term.expression))
        return replace(term, expression=parse(text))

    return _terms(change)


def _reference(**changes: Callable[[float], float]) -> Corruption:
    def corrupt(pair: Pair) -> Pair | None:
        if pair.database is None:
            return None
        size = pair.database.reference
        made: dict[str, Any] = {n: change(getattr(size, n)) for n, change in changes.items()}
        return replace(pair, database=replace(pair.database, reference=replace(size, **made)))

    return corrupt


def _moved_reference(place: Callable[[Pair], tuple[float, float, float]]) -> Corruption:
    """Moments about another point, by a twentieth of a chord at least."""

    def corrupt(pair: Pair) -> Pair | None:
        if pair.database is None:
            return None
        size = pair.database.reference
        point = place(pair)
        if np.linalg.norm(np.subtract(point, size.moment_reference)) < 0.05 * size.chord:
            return None
        return replace(
            pair, database=replace(pair.database, reference=replace(size, moment_reference=point))
        )

    return corrupt


def _half_a_chord_aft(pair: Pair) -> tuple[float, float, float]:
    assert pair.database is not None
    x, y, z = pair.database.reference.moment_reference
    return (x - 0.5 * pair.database.reference.chord, y, z)


_MOMENTS = (*AXES["roll"], *AXES["pitch"], *AXES["yaw"])
_SURFACES = ("delta_elevator", "delta_aileron", "delta_rudder", "delta_aileron_left",
             "delta_aileron_right", "delta_elevator_left", "delta_elevator_right")  # fmt: skip
#: Kinds of wrong databases.
DATABASES: dict[str, Corruption] = {
    "drag negative": _scaled(AXES["drag"], "(-1)"),
    "lift reversed": _scaled(AXES["lift"], "(-1)"),
    "side force reversed": _scaled(AXES["side"], "(-1)"),
    "Cm reversed": _scaled(AXES["pitch"], "(-1)"),
    "Cl reversed": _scaled(AXES["roll"], "(-1)"),
    "Cn reversed": _scaled(AXES["yaw"], "(-1)"),
    "no Cm": _terms(lambda t: None if t.axis in AXES["pitch"] else t, always=True),
    "no Cl": _terms(lambda t: None if t.axis in AXES["roll"] else t, always=True),
    "Cl and Cn exchanged": _exchanged("roll", "yaw"),
    "Cl and Cm exchanged": _exchanged("roll", "pitch"),
    "drag and lift exchanged": _exchanged("drag", "lift"),
    "side force and lift exchanged": _exchanged("side", "lift"),
    "alpha and beta exchanged": _exchanged_names("alpha", "beta"),
    "aileron and rudder exchanged": _exchanged_names("delta_aileron", "delta_rudder"),
    "dampings reversed": _of([*HATS, *HATS.values()], "(-1)", _MOMENTS),
    "damping in pitch reversed": _of(["q", "q_hat"], "(-1)", AXES["pitch"]),
    "damping in roll reversed": _of(["p", "p_hat"], "(-1)", AXES["roll"]),
    "damping in yaw reversed": _of(["r", "r_hat"], "(-1)", AXES["yaw"]),
    "slopes per degree": _of(["alpha", "beta", *_SURFACES], "0.017453292519943295"),
    "angles in degrees": _of(["alpha", "beta", *_SURFACES], "57.29577951308232"),
    "surfaces per degree": _of(_SURFACES, "0.017453292519943295"),
    "surfaces reversed": _of(_SURFACES, "(-1)"),
    "elevator reversed": _of(
        ["delta_elevator", "delta_elevator_left", "delta_elevator_right"], "(-1)"
    ),
    "rudder reversed": _of(["delta_rudder"], "(-1)"),
    "rates per q l / V": _of([*HATS.values()], "2"),
    "beta reversed": _of(["beta"], "(-1)"),
    "area in ft2": _reference(area=lambda area: area / FOOT**2),
    "span in ft": _reference(span=lambda span: span / FOOT),
    "chord in ft": _reference(chord=lambda chord: chord / FOOT),
    "moment reference zero": _moved_reference(lambda pair: (0.0, 0.0, 0.0)),
    "moment reference half a chord aft": _moved_reference(_half_a_chord_aft),
}
