"""Parts as written become the variables and load terms of a database."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, UnknownNameError, nearest, together
from aerodb.nomenclature import channel
from aerodb.parts import body, engine, fuselage, leg, rotor, section, surface, wake
from aerodb.parts.entry import Disc, Entry
from aerodb.parts.frame import MOTION
from aerodb.parts.writing import Writer
from aerodb.support import validated
from aerodb.tables import (
    CONSTANTS,
    HAT_RATES,
    AeroDatabase,
    Expression,
    ReferenceGeometry,
    Term,
    Variable,
    parse,
)

#: Kind -> its keys, and what writes it.
_WRITERS: Final[dict[str, tuple[type[Entry], Callable[..., Any]]]] = {
    "section": (section.Section, section.write),
    "surface": (surface.Surface, surface.write),
    "fuselage": (fuselage.Fuselage, fuselage.write),
    "engine": (engine.Engine, engine.write),
    "rotor": (rotor.Rotor, rotor.write),
    "leg": (leg.Leg, leg.write),
    "body": (body.Body, body.write),
    "wake": (wake.Wake, wake.write),
}
KINDS: Final[tuple[str, ...]] = tuple(_WRITERS)
#: Of which part the variables are that all parts share.
_SHARED: Final = "parts"
#: Key -> signs by which its values are those of the mirror image.
_MIRRORED: Final = {
    **dict.fromkeys(("position", "root", "tip", "direction", "axis"), (1.0, -1.0, 1.0)),
    **dict.fromkeys(("axes", "tilt_axis"), (-1.0, 1.0, -1.0)),
}


@dataclass(frozen=True)
class Expansion:
    """What parts are in a database: variables by name, and load terms."""

    variables: Mapping[str, Variable]
    terms: tuple[Term, ...]


def expand(
    parts: Mapping[str, Any], reference: ReferenceGeometry, known: Mapping[str, str]
) -> Expansion:
    """Return the variables and load terms [N, N m] of parts as they are written.

    Parameters
    ----------
    parts : name -> entry of the file.
    reference : of the database; loads are about its moment reference.
    known : variables, parameters, tables and free inputs that the database has beside them -> what
        each is, in words.

    Raises InputError of all parts, each with its place such as ``[parts.tail] position``, for an
    unknown kind or key, a missing one, names that two things have, an unknown name or engine, and
    parts whose flow depends on each other.
    """
    point = np.array(reference.moment_reference)
    written: list[Writer] = []
    discs: dict[str, Disc] = {}
    wrong: list[InputError] = []
    entries = []
    for name, part in parts.items():
        try:
            entries.append(_entry(name, part))
        except InputError as error:
            wrong.append(error)
    wakes = [place for entry, _, place in entries if isinstance(entry, wake.Wake)]
    if wakes[1:]:
        wrong.append(InputError("a second wake", wakes[1], "one vortex pair at a time"))
    if wrong:
        raise together(wrong)
    air: wake.MovingAir | None = None
    for turn in range(3):
        for entry, name, place in entries:
            if _turn_of(type(entry)) != turn:
                continue
            try:
                for sided, writer in _sides(entry, name, place):
                    writer.air = air
                    made = _WRITERS[entry.kind][1](sided, writer, point, discs)
                    if isinstance(made, Disc):
                        discs[writer.name] = made
                    elif isinstance(made, wake.MovingAir):
                        air = made
                    written.append(writer)
            except InputError as error:
                wrong.append(error)
        if wrong:
            raise together(wrong)
    _check_names(written, known)
    variables = {name: v for writer in written for name, v in writer.variables.items()}
    terms = tuple(term for writer in written for term in writer.terms)
    trees = [each.expression for each in variables.values()] + [each.expression for each in terms]
    used = {name for tree in trees for name in tree.names}
    meaning = "velocity through the air along body"
    motion = {
        name: Variable(parse(text), "m/s", f"{meaning} {axis}", part=_SHARED)
        for axis, (name, text) in zip("xyz", MOTION.items(), strict=True)
        if name in used
    }
    return Expansion(motion | variables, terms)


def _turn_of(kind: type[Entry]) -> int:
    """When a kind is written: the air that others are in, then slipstreams, then the rest."""
    if kind is wake.Wake:
        return 0
    return 1 if kind in (engine.Engine, rotor.Rotor) else 2


def felt_at_places(database: AeroDatabase) -> bool:
    """Return whether all aerodynamic loads of a database are those of its parts, so that each feels
    a wake at its own place: not those of tables and derivatives, which are the aircraft's."""
    kinds = {part["kind"] for part in database.parts.values()} - {"leg", "wake"}
    return bool(kinds) and all(term.part for term in database.terms)


def rotors_of(parts: Mapping[str, Any]) -> dict[str, rotor.Rotor]:
    """Return the rotors of parts [SI] by what their variables begin with; a mirrored one has two.
    Raises InputError as `expand`."""
    return {
        writer.name: sided
        for entry, name, place in (_entry(name, part) for name, part in parts.items())
        for sided, writer in _sides(entry, name, place)
        if isinstance(sided, rotor.Rotor)
    }


def _entry(name: str, part: Any) -> tuple[Entry, str, str]:
    """A part as its kind reads it, its name, and its place in the file."""
    place = f"[parts.{name}]"
    try:
        Variable(parse(name))
    except InputError as error:
        raise InputError(error.what, place, error.remedy) from None
    if not isinstance(part, Mapping) or not isinstance(part.get("kind"), str):
        raise InputError("a part without kind", place, f"kinds: {', '.join(KINDS)}")
    kind = part["kind"]
    if kind not in _WRITERS:
        raise InputError(f"unknown kind '{kind}'", place, nearest(kind, KINDS))
    return validated(_WRITERS[kind][0], part, place), name, place


def _sides(entry: Entry, name: str, place: str) -> Iterable[tuple[Entry, Writer]]:
    """The part itself, or its right and its left."""
    lateral = [getattr(entry, key)[1] for key in ("position", "root", "tip") if hasattr(entry, key)]
    if not entry.mirror:
        side = -1.0 if sum(lateral) < 0.0 else 1.0
        return [(entry, Writer(name, name, place, side))]
    if sum(lateral) <= 0.0:
        raise InputError("a mirrored part that is not on the right", place, "give it a positive y")
    other: dict[str, Any] = {
        key: tuple(sign * x for sign, x in zip(signs, getattr(entry, key), strict=True))
        for key, signs in _MIRRORED.items()
        if hasattr(entry, key)
    }
    if isinstance(entry, rotor.Rotor):
        other["turns"] = -entry.turns
    return [
        (entry, Writer(name, f"{name}_right", place, 1.0)),
        (entry.model_copy(update=other), Writer(name, f"{name}_left", place, -1.0)),
    ]


def _check_names(written: list[Writer], known: Mapping[str, str]) -> None:
    """Raise InputError for names that are taken, unknown names, and loops."""
    owner = {**known, **dict.fromkeys(MOTION, "all parts")}
    wrong: dict[str, InputError] = {}  # both sides of a part have the same mistake
    for writer in written:
        for name in (*writer.variables, writer.name):
            if name in owner and owner[name] != writer.where:
                wrong.setdefault(
                    writer.where,
                    InputError(
                        f"'{name}' is a name of {owner[name]} too",
                        writer.where,
                        f"choose another name for the part or for {owner[name]}",
                    ),
                )
            owner[name] = writer.where
    variables = {name: v.expression for w in written for name, v in w.variables.items()}
    names = {*known, *variables, *MOTION, *CONSTANTS, *HAT_RATES}
    for writer in written:
        trees = {name: variable.expression for name, variable in writer.variables.items()}
        trees |= {term.name: term.expression for term in writer.terms}
        for of, tree in trees.items():
            place = f"{writer.where} {writer.keys.get(of, '')}".strip()
            for error in _unknown(tree, names, known, place):
                wrong.setdefault(str(error), error)
    if wrong:
        raise together([*wrong.values()])
    _check_loops(written, variables)


def _unknown(
    tree: Expression, names: Collection[str], known: Collection[str], place: str
) -> Iterable[InputError]:
    """The names and tables of an expression that nothing has."""
    for name in sorted(tree.names.difference(names)):
        try:
            channel(name)
        except UnknownNameError:
            yield InputError(f"unknown name '{name}'", place, nearest(name, names))
    for table in sorted(tree.tables.difference(known)):
        yield InputError(f"no table or function '{table}'", place, nearest(table, known))


def _check_loops(written: list[Writer], variables: Mapping[str, Any]) -> None:
    """Raise InputError for variables of parts that use each other, at the downwash that closes the
    loop where there is one."""
    state: dict[str, int] = {}  # 1 while its own are visited, 2 afterwards
    for begin in variables:
        path: list[str] = []
        pending = [(begin, False)]
        while pending:
            name, left = pending.pop()
            if left:
                state[path.pop()] = 2
            elif state.get(name) == 1:
                raise _loop(path[path.index(name) :], written)
            elif name not in state:
                state[name] = 1
                path.append(name)
                pending.append((name, True))
                inside = variables[name].names & variables.keys()
                pending += [(each, False) for each in sorted(inside) if state.get(each) != 2]


def _loop(names: list[str], written: list[Writer]) -> InputError:
    of = {name: writer for writer in written for name in writer.variables}
    at = next((name for name in names if name.endswith("_downwash")), names[0])
    parts = list(dict.fromkeys(of[name].part for name in names))
    return InputError(
        f"the flow at {' and '.join(parts)} depends on {'each other' if parts[1:] else 'itself'}:"
        f" {' uses '.join([*names, names[0]])}",
        f"{of[at].where} {of[at].keys.get(at, '')}".strip(),
        "let one of them use the aircraft's alpha",
    )
