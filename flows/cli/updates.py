"""``aerodb update``: estimate declared increments, store a candidate, report the error."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.known_names import METHODS
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import (
    Beside,
    Direct,
    Flights,
    HoldOut,
    Select,
    Vehicle,
    Verbose,
    beside_of,
    held_out,
)
from aerodb.flows.cli.vehicles import read_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aerodb.storage.catalogue import Catalogue, VersionRow


def update(
    context: typer.Context,
    vehicle: Vehicle = None,
    model: Annotated[
        Path | None, typer.Option(help="Model file (TOML): the declared increments.")
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(help="Use model and flights of this version, without retracted flights."),
    ] = None,
    baseline: Annotated[str, typer.Option(help="Version to build on.")] = "released",
    beside: Beside = None,
    flights: Flights = None,
    hold_out: HoldOut = None,
    method: Annotated[
        str | None,
        typer.Option(help=f"Method by which to estimate: {METHODS}; default: regression."),
    ] = None,
    all_free: Annotated[
        bool,
        typer.Option(
            "--all-free",
            help="Free all terms of the database on the declared axes as well, compare both on"
            " held-out flights, and say which to keep. The candidate has the declared terms only.",
        ),
    ] = False,
    select: Select = None,
    direct: Direct = False,
    verbose: Verbose = False,
) -> None:
    """Estimate declared increments, store a candidate version, and report the error before and
    after.

    Example: aerodb update --vehicle my-glider --model increments.toml
    """
    from aerodb.conditioning import checked_conditions
    from aerodb.flows.update import update_flow
    from aerodb.identification import chosen_methods
    from aerodb.increments import parse_model_file
    from aerodb.tasks.references import vehicle_of

    session: Session = context.obj
    if method is not None and chosen_methods([method])[0].display:
        raise InputError(
            f"{method} is a display: it makes no candidate", "update", "use another method"
        )
    if (model is None) == (like is None):
        raise InputError(
            "which increments?", "update", "give either --model FILE or --like VERSION"
        )
    catalogue = session.catalogue()
    vehicle = vehicle_of(catalogue, vehicle)
    if like is not None:
        earlier = _as_before(catalogue, catalogue.version(vehicle, like))
        text, method = earlier.model, method or earlier.method
        flights, hold_out = flights or earlier.flights, hold_out or earlier.held_out
        select, beside = select or earlier.select, beside or earlier.beside
    elif model is not None:
        text = read_text(model)
        parse_model_file(text, str(model))
    row = catalogue.version(vehicle, baseline)
    chosen = chosen_flights(catalogue, vehicle, flights)
    parameters = {
        "vehicle": vehicle,
        "baseline": row.id,
        "flights": chosen,
        "model": text,
        "hold_out": held_out(catalogue, vehicle, hold_out),
        **({} if method is None else {"method": method}),
        **beside_of(catalogue, vehicle, beside),
        **({"all_free": True} if all_free else {}),
        **({"select": list(checked_conditions(select))} if select else {}),
    }
    document = session.run(update_flow, parameters, direct)
    print_update(session, document, verbose)
    if all_free:
        say_held_or_free(session, document["held_or_free"])
    session.answer(document)


def chosen_flights(catalogue: "Catalogue", vehicle: str, flights: list[str] | None) -> list[str]:
    """Return the ids of `flights`, by default of all of the vehicle.

    Raises InputError where none is stored, or one is unknown.
    """
    chosen = (
        [catalogue.flight(ref, vehicle).id for ref in flights]
        if flights
        else [f.id for f in catalogue.flights(vehicle)]
    )
    if not chosen:
        raise InputError(
            "no flight is stored",
            f"vehicle {vehicle}",
            "ingest one: aerodb flight ingest LOG --vehicle " + vehicle,
        )
    return chosen


@dataclass(frozen=True)
class _EarlierUpdate:
    """Model file, method, flights, held-out flights and selection of the update that made a
    version, and the name of the line of friction where that is of legs alone."""

    model: str
    method: str | None
    flights: list[str]
    held_out: list[str] | None
    select: list[str] | None
    beside: str | None


def _as_before(catalogue: "Catalogue", version: "VersionRow") -> _EarlierUpdate:
    """Return the update that made a version, without retracted flights."""
    from aerodb.tasks.result_versions import NAMES, RELEASED

    settings = catalogue.settings_of([version.id])[version.id]
    if "model" not in settings:
        raise InputError(
            "was not made by an update",
            f"version {version.label}",
            "name one that was, or give --model FILE",
        )
    used = [use for use in catalogue.version_flights(version.id) if use.role != "excluded"]
    rows = catalogue.flights_by_id(use.flight for use in used)
    standing = [use for use in used if rows[use.flight].retracted_utc is None]
    held = [use.flight for use in standing if use.role == "held_out"]
    return _EarlierUpdate(
        settings["model"],
        settings.get("method"),
        [use.flight for use in standing],
        held or None,
        settings.get("select"),
        NAMES["friction"][RELEASED] if "with" in settings else None,
    )


def print_update(session: Session, document: dict[str, Any], verbose: bool) -> None:
    """Print an update: five lines to decide on and the error per axis; with `verbose` also
    increments, all errors and remarks."""
    from aerodb.report import in_words, term_name, term_unit

    say_decision(session, document)
    if not verbose:
        return
    session.say()
    session.say(
        f"candidate {document['label']} ({document['candidate'][:12]}) on baseline"
        f" {document['baseline'][:12]}"
    )
    say_flights(session, document)
    for entry in document["increments"]:
        session.say()
        shares = entry["outputs"] or {"": entry["r_squared"]}
        told = ", ".join(f"{name} {share:.3f}".strip() for name, share in shares.items())
        session.say(f"increment on {entry['axis']} (R2 {told}):")
        session.table(
            ["term", "value", "standard error", "unit", "VIF"],
            [
                [
                    term_name(t["term"]),
                    f"{t['value']:.5g}",
                    f"{t['standard_error']:.2g}",
                    term_unit(t["term"]),
                    f"{t['vif']:.3g}",
                ]
                for t in entry["terms"]
            ],
            numbers=(1, 2, 4),
        )
    session.say()
    say_axes(session, document)
    say_derivatives(session, document.get("derivatives", []))
    for sentence in document["remarks"]:
        session.say(f"- {in_words(sentence)}")


def say_held_or_free(session: Session, found: dict[str, Any]) -> None:
    """Print the held-out errors with the terms of the database held and free, and which to keep."""
    from aerodb.report import held_or_free_words

    session.say()
    session.say("error on held-out flights, with the terms of the database held and free:")
    session.table(
        ["axis", "before", "held", "all free"],
        [
            [axis, *(_number(errors[name]) for name in ("before", "held", "free"))]
            for axis, errors in found["axes"].items()
        ],
        numbers=(1, 2, 3),
    )
    advice, *terms = held_or_free_words(found)
    session.say(advice)
    for each in terms:
        session.say(f"  {each}")


def say_decision(session: Session, document: dict[str, Any], given: "Sequence[str]" = ()) -> None:
    """Print verdict, change, proof, gate and next command, then the error per axis in short.

    given : options that the loop was asked with.
    """
    from aerodb.report import decision, error_rows, shown_axes

    told = decision(document, session.units, given=given)
    lines = [
        ("" if number else label, text.replace("\u2212", "-"))
        for label, texts in told.lines
        for number, text in enumerate(texts)
    ]
    place = next((k for k, (label, _) in enumerate(lines) if label == "next"), None)
    then = "" if place is None else lines[place][1]
    below = [] if place is None else lines[place + 1 :]
    session.headlines(told.verdict, lines[:place], then, below)
    session.say()
    shown = shown_axes(document)
    rows = [row for row in error_rows(document) if row["axis"] in shown]
    session.table(
        ["axis", "error before", "after", "of flown", "noise floor", "outcome"],
        [
            [
                row["label"],
                _number(row["before"]),
                _number(row["after"]),
                "-" if row["of_flown"] is None else f"{100 * row['of_flown']:.0f} %",
                _number(row["floor"]),
                row["outcome"],
            ]
            for row in rows
        ],
        numbers=(1, 2, 3, 4),
    )
    session.say(f"details: -v    report: {document['page']}")


def say_flights(session: Session, document: dict[str, Any]) -> None:
    """Print the roles of the flights: identified, validated (and how often before), excluded and
    why."""
    used, held = document["flights"]["identified"], document["flights"]["held_out"]
    session.say(
        f"identified on {len(used)} flights, validated on {len(held) or 'none'}"
        f" ({document['validation']['kind']})"
    )
    looks = {
        flight: count
        for flight, count in document["validation"]["looked_at_before"].items()
        if count
    }
    excluded = [entry["flight"] for entry in document["flights"]["excluded"]]
    names = session.catalogue().flight_labels([*looks, *excluded])
    if looks:
        session.say(
            "held-out flights already used to validate: "
            + ", ".join(f"{names.get(f, f[:12])} {n} times" for f, n in looks.items())
        )
    for entry in document["flights"]["excluded"]:
        flight = entry["flight"]
        session.say(f"excluded {names.get(flight, flight[:12])}: {entry['reason']}")


def say_axes(session: Session, document: dict[str, Any]) -> None:
    """Print the error before and after, per axis."""
    session.table(
        [
            "axis",
            "before",
            "after",
            "held out: before",
            "after",
            "without its constant",
            "after",
            "noise floor",
            "outcome",
        ],
        [
            [
                f"{axis} [{v['unit']}]" if "unit" in v else axis,
                *(_number(v[k]) for k in _COLUMNS),
                v["outcome"],
            ]
            for axis, v in document["axes"].items()
        ],
        numbers=tuple(range(1, 8)),
    )


#: Number of changed derivatives that are printed.
_LARGEST = 5


def say_derivatives(session: Session, derivatives: list[dict[str, Any]]) -> None:
    """Print the changes of derivatives inside the data that change an axis most."""
    from aerodb.report import term_unit

    if not derivatives:
        return
    session.say()
    session.say("largest changes of derivatives inside the data (mean over the flights' samples):")
    session.table(
        ["derivative", "before", "after", "unit"],
        [
            [
                f"{d['axis']} with {d['variable']}",
                f"{d['before']:.4g}",
                f"{d['after']:.4g}",
                term_unit(d["variable"]),
            ]
            for d in derivatives[:_LARGEST]
        ],
        numbers=(1, 2),
    )


_COLUMNS = (
    "rms_before",
    "rms_after",
    "held_out_rms_before",
    "held_out_rms_after",
    "held_out_without_constant_before",
    "held_out_without_constant_after",
    "noise_floor",
)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.5f}"
