"""``aerodb version diff``: what was edited between two versions, and what follows."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from aerodb.flows.cli.output import Session, percent
from aerodb.flows.cli.references import Vehicle
from aerodb.nomenclature import AXES

if TYPE_CHECKING:
    from aerodb.units import UnitSystem

#: Largest number of edits, and of nodes of a table, that are printed.
_EDITS: Final = 15
_NODES: Final = 12
#: Unit of a regressor that is no product of channels (`aerodb.report.term_unit`).
_NO_SLOPE: Final = "?"


def diff(
    context: typer.Context,
    before: Annotated[str, typer.Argument(help="The version to start from.")],
    after: Annotated[str, typer.Argument(help="The version to compare with it.")],
    vehicle: Vehicle = None,
    figure: Annotated[
        Path | None, typer.Option(help="Also draw slices to this file (.png, .svg, .pdf).")
    ] = None,
    nodes: Annotated[
        bool,
        typer.Option("--nodes", "-v", help="Also print all edits, their flights and table nodes."),
    ] = False,
) -> None:
    """Show what was edited between two versions, and the coefficient that changes most.

    Example: aerodb version diff v0001 candidate --figure diff.png
    """
    from aerodb.storage.workspace import write_for_user
    from aerodb.tasks.references import version_of
    from aerodb.tasks.view import compare_versions, draw_differences

    session: Session = context.obj
    workspace = session.workspace()
    catalogue = session.catalogue()
    old, new = version_of(catalogue, before, vehicle), version_of(catalogue, after, vehicle)
    document = compare_versions(catalogue, old, new)
    picture = None if figure is None else draw_differences(catalogue, old, new, figure.suffix)
    released = catalogue.named(new.vehicle, "released")
    candidate = new.parent is not None and (released is None or released.version != new.id)
    then = f"aerodb version gate {new.label} --vehicle {new.vehicle}" if candidate else ""
    _say_edits(session, f"{new.vehicle}: {old.label} -> {new.label}", document, then, nodes)
    if nodes:
        labels = catalogue.flight_labels({f for t in document["terms"] for f in t["flights"]})
        _say_flights(session, document, labels)
        _say_nodes(session, document)
    if figure is not None and picture is not None:
        session.say(f"figure: {write_for_user(workspace, figure, picture)}")
    session.answer(document)


def _say_edits(
    session: Session, which: str, document: Mapping[str, Any], then: str, whole: bool
) -> None:
    """Print how many edits there are and where they hold, each in a line, and the curve that
    changes most."""
    from aerodb.report import edits_of

    edits = edits_of(document)
    tables = document["edited_tables"]
    count = len(edits) + len(tables)
    if not count:
        session.say(f"{which}: no difference")
        return
    changed = {term["axis"] for term in edits} | {entry["axis"] for entry in document["nodes"]}
    same = " ".join(axis for axis in AXES if axis not in changed) if changed <= {*AXES} else ""
    session.headlines(
        f"{which}, {'one edit' if count == 1 else f'{count} edits'}",
        [
            ("largest", _edit(edits[0]) if edits else ""),
            ("flown", _flown(edits, session.units)),
            ("edited", _tables(document)),
            ("unchanged", f"{document['unchanged_tables']} tables{same and f'; {same}'}"),
        ],
        then,
    )
    if edits:
        session.say()
        shown = edits if whole else edits[:_EDITS]
        session.table(
            ["axis", "edit", "change", "std error", "unit", "of axis"],
            [_row(term) for term in shown],
            numbers=(2, 3, 5),
        )
        if len(shown) < len(edits):
            session.say(f"and {len(edits) - len(shown)} smaller edits: --nodes")
        _say_reach(session, document)
    if document["curve"] is not None:
        _say_curve(session, document["curve"])
    if not whole:
        session.say("flights, and changes at breakpoints of tables: --nodes")


def _edit(term: Mapping[str, Any]) -> str:
    """Return an edit in a few words, +- half of its 95 % interval."""
    from aerodb.support import half_interval

    if term["kind"] != "increment":
        return f"{term['axis']} {_what(term)}".strip()
    unit = "" if term["unit"] in ("-", _NO_SLOPE) else f" {term['unit']}"
    size = f"{term['change']:+.3g} +- {half_interval(term['sigma']):.2g}{unit}"
    return f"{term['axis']} {_what(term)} {size}"


def _what(term: Mapping[str, Any]) -> str:
    """Return in words what is edited."""
    if term["kind"] != "increment":
        sides = f"{term['before'] or 'none'} -> {term['after'] or 'none'}"
        return f"{term['kind']} {term['name']}: {sides}"
    what: str = term["what"]
    return what if what == "constant" or term["unit"] == _NO_SLOPE else f"slope with {what}"


def _row(term: Mapping[str, Any]) -> list[str]:
    if term["kind"] == "parameter":
        sigma = "" if term["sigma"] is None else f"{term['sigma']:.2g}"
        unit = "" if term["unit"] == "1" else term["unit"]
        share = "" if term["share"] is None else percent(term["share"])
        return ["", f"parameter {term['name']}", f"{term['change']:+.3g}", sigma, unit, share]
    if term["kind"] != "increment":
        return [term["axis"], _what(term), "", "", "", ""]
    return [
        term["axis"],
        _what(term),
        f"{term['change']:+.3g}",
        f"{term['sigma']:.2g}",
        "" if term["unit"] == _NO_SLOPE else term["unit"],
        percent(term["share"]),
    ]


def _flown(edits: Sequence[Mapping[str, Any]], units: "UnitSystem") -> str:
    """Return where the flights of the edits have been in alpha, or in the variable of the first
    edit, and where the edits have faded; and how many flights there are."""
    from aerodb.report import display_unit

    flights = {flight for term in edits for flight in term["flights"]}
    reached = [term["envelope"] for term in edits if term["envelope"]]
    if not reached:
        return ""
    name = "alpha" if any("alpha" in each for each in reached) else next(iter(reached[0]))
    of = [each[name] for each in reached if name in each]
    factor, unit = display_unit(name, units)
    low, high = (factor * side for side in (min(e["low"] for e in of), max(e["high"] for e in of)))
    words = f"{len(flights)} flights, {name} {low:.3g} to {high:.3g} {unit or ''}".rstrip()
    if any(each["gone_below"] is None for each in of):
        return words
    gone = (min(each["gone_below"] for each in of), max(each["gone_above"] for each in of))
    faded = " and ".join(f"{factor * each:.3g}" for each in gone)
    return f"{words}; fades out at {faded} {unit or ''}".rstrip()


def _tables(document: Mapping[str, Any]) -> str:
    """Return which tables differ, and how; empty where none does."""
    words = []
    for name in document["edited_tables"]:
        if name in document["tables"]:
            words.append(f"table {name}: {document['tables'][name]}")
        elif name in document["not_addressable"]:
            words.append(f"table {name} by up to {document['not_addressable'][name]:.3g}")
        else:
            words.append(f"table {name}")
    more = f"; {len(words) - _NODES} more" if len(words) > _NODES else ""
    return f"{'; '.join(words[:_NODES])}{more}"


def _say_reach(session: Session, document: Mapping[str, Any]) -> None:
    """Print over which range of each variable flights have been, and where the edits have faded to
    nothing beyond."""
    from aerodb.report import display_unit, faded_at

    rows = []
    for each in faded_at(document):
        factor, unit = display_unit(each["variable"], session.units)
        gone = (each["gone_below"], each["gone_above"])
        faded = " and ".join(f"{factor * side:.3g}" for side in gone if side is not None)
        rows.append(
            [
                " ".join(axis for axis in AXES if axis in each["axes"]) or " ".join(each["axes"]),
                f"{each['variable']} [{unit}]" if unit else each["variable"],
                f"{factor * each['low']:.3g} to {factor * each['high']:.3g}",
                faded or "nowhere: held at the edge",
            ]
        )
    if rows:
        session.say()
        session.table(["axes", "variable", "flown", "faded to nothing at"], rows)


def _say_curve(session: Session, curve: Mapping[str, Any]) -> None:
    """Print a coefficient before, its change, and whether flights have been there."""
    from aerodb.report import display_unit
    from aerodb.tables import STAND_IN_SPEED

    points, held = curve["points"], []
    for name, value in curve["held"].items():
        factor, unit = display_unit(name, session.units)
        if value and (name, value) != ("V", STAND_IN_SPEED):
            held.append(f"{name} {factor * value:.4g} {unit or ''}".rstrip())
    factor, unit = display_unit(curve["variable"], session.units)
    if unit is None:
        factor, unit = curve["factor"], curve["unit"]
    unit = f" [{unit}]" if unit else ""
    rows = [
        (f"{curve['variable']}{unit}", [f"{factor * p['at']:.4g}" for p in points]),
        (f"{curve['axis']} before", [f"{p['before']:.4f}" for p in points]),
        ("change", [f"{p['change']:+.4f}" for p in points]),
        ("flown", ["yes" if p["inside_data"] else "no" for p in points]),
    ]
    session.say()
    wide = max(len(label) for label, _ in rows)
    for label, cells in rows:
        session.say(f"{label:<{wide}}{''.join(f'{cell:>8}' for cell in cells)}".rstrip())
    session.say(f"others held at zero{''.join(f', {each}' for each in held)}")


def _say_flights(session: Session, document: Mapping[str, Any], labels: Mapping[str, str]) -> None:
    """Print the flights behind the edits, once for those that share them."""
    from aerodb.report import edits_of

    behind: dict[tuple[str, ...], list[str]] = {}
    for term in edits_of(document):
        if term["flights"]:
            behind.setdefault(tuple(term["flights"]), []).append(f"{term['axis']} {term['what']}")
    for flights, terms in behind.items():
        session.say()
        session.say(f"{', '.join(dict.fromkeys(terms))}: {', '.join(labels[f] for f in flights)}")


def _say_nodes(session: Session, document: Mapping[str, Any]) -> None:
    """Print the largest changes at the nodes of tables, in the order of the nodes."""
    from aerodb.report import display_unit

    for entry in document["nodes"]:
        units = {name: display_unit(name, session.units) for name in entry["channels"]}
        largest = sorted(entry["nodes"], key=lambda node: -abs(node["change"]))[:_NODES]
        session.say()
        session.say(
            f"{entry['axis']} at the breakpoints of {entry['table']}: {len(entry['nodes'])} change,"
            f" {entry['unchanged']} do not"
        )
        headings = [f"{name} [{unit or '-'}]" for name, (_, unit) in units.items()]
        session.table(
            ["node", *headings, "change", "sigma", "flown"],
            [
                [
                    str(n["index"]),
                    *(f"{units[name][0] * value:.4g}" for name, value in n["at"].items()),
                    f"{n['change']:.5g}",
                    f"{n['sigma']:.2g}",
                    "yes" if n["inside_data"] else "no",
                ]
                for n in sorted(largest, key=lambda node: list(node["index"]))
            ],
            numbers=range(1, len(units) + 3),
        )
        if len(entry["nodes"]) > _NODES:
            session.say(f"and {len(entry['nodes']) - _NODES} smaller ones (--json lists them)")
