"""``aerodb estimate``: declared increments by one method or by all, beside each other."""

from pathlib import Path
from typing import Annotated, Any

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.known_names import METHODS
from aerodb.flows.cli.mode_tables import print_modes
from aerodb.flows.cli.output import HALF_INTERVAL, Session, plus_minus
from aerodb.flows.cli.references import Beside, Select, Verbose, beside_of
from aerodb.flows.cli.vehicles import read_text
from aerodb.support import counted

#: Parameters of single records, which only the report lists.
_OF_RECORDS = ("initial_", "bias_")
#: Most methods that are printed beside each other.
_SIDE_BY_SIDE = 4
#: Most flights that are named on one line.
_NAMED = 3


def estimate(
    context: typer.Context,
    model: Annotated[Path, typer.Option(help="Model file (TOML): increments or a linear model.")],
    vehicle: Annotated[
        str | None,
        typer.Option(
            help="The vehicle; for increments optional if there is only one; not with --record.",
            show_default=False,
        ),
    ] = None,
    record: Annotated[
        list[Path] | None,
        typer.Option(
            help="Table of time histories (CSV, MAT, Parquet, text) for a linear model: no vehicle"
            " and no workspace are needed; repeat the option."
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method",
            "--methods",
            help=f"`all`, or by name: {METHODS}; repeat the option.",
        ),
    ] = None,
    baseline: Annotated[
        str, typer.Option(help="Version to build on; `none`: whole derivatives.")
    ] = "released",
    beside: Beside = None,
    flights: Annotated[
        list[str] | None,
        typer.Option(help="Flights to use; default: all of the vehicle that are not rejected."),
    ] = None,
    whole: Annotated[
        bool,
        typer.Option(
            "--whole",
            help="Methods that fly take whole flights, not only their manoeuvres: in turbulence the"
            " rest tells of the aircraft too.",
        ),
    ] = False,
    select: Select = None,
    output: Annotated[
        Path | None, typer.Option(help="HTML page to write, with fitted responses and residuals.")
    ] = None,
    report: Annotated[bool, typer.Option(help="Print the whole report of each method.")] = False,
    verbose: Verbose = False,
) -> None:
    """Estimate declared increments by one or several methods, and say which to believe and why.
    Nothing is added to the database: `aerodb update --method` does that.

    Example: aerodb estimate --vehicle my-glider --model increments.toml --methods all

    Without a vehicle: aerodb estimate --model roll.toml --record doublet.csv --method output-error
    """
    from aerodb.conditioning import checked_conditions
    from aerodb.identification import chosen_methods, declares_state_space, parse_state_space
    from aerodb.increments import parse_model_file

    session: Session = context.obj
    text = read_text(model)
    linear = declares_state_space(text, str(model))
    (parse_state_space if linear else parse_model_file)(text, str(model))
    conditions = list(checked_conditions(select or ()))
    names = method or (["output-error"] if linear else [])
    if names:
        chosen_methods(names)
    if record:
        if vehicle is not None or flights or select or not linear:
            raise InputError(
                "--record takes a linear model and no vehicle",
                str(model),
                "declare [state_space] in the model file, or ingest the log and name the vehicle",
            )
        document = _of_records(session, record, text, names, output is not None)
    elif vehicle is None and linear:
        raise InputError(
            "there is nothing to estimate from",
            remedy="name a vehicle (--vehicle), or files with the columns of a linear model"
            " (--record)",
        )
    else:
        from aerodb.tasks.references import vehicle_of

        vehicle = vehicle_of(session.catalogue(), vehicle)
        document = _of_flights(
            session,
            vehicle,
            flights,
            (baseline, beside),
            text,
            names,
            whole,
            output is not None,
            conditions,
        )
    page, rolls = document.pop("page", None), document.pop("rolls", False)
    named = " ".join(f"--flights {each}" for each in flights or ())
    then = (
        ""
        if vehicle is None or linear or parse_model_file(text).inertias or rolls
        else f"aerodb close-loop --vehicle {vehicle} --baseline {baseline} {named}".rstrip()
        if parse_model_file(text).parameters
        else f"aerodb update --vehicle {vehicle} --model {model} --method {document['believe']}"
        f" --baseline {baseline} {named}".rstrip()
    )
    _print(session, document, report, verbose, "" if baseline == "none" else then)
    if output is not None and page is not None:
        output.write_text(page, "utf-8")
        session.say(f"page: {output}")
    session.answer(document)


def _of_records(
    session: Session, files: list[Path], model: str, methods: list[str], page: bool
) -> dict[str, Any]:
    from aerodb.storage.workspace_settings import load_settings
    from aerodb.tasks.steps import estimate_records

    with session.waiting("estimating"):
        document = estimate_records(
            files, model, methods, load_settings(session.root).limits, page=page
        )
    return document


def _of_flights(
    session: Session,
    vehicle: str,
    flights: list[str] | None,
    versions: tuple[str, str | None],
    model: str,
    methods: list[str],
    whole: bool,
    page: bool,
    select: list[str],
) -> dict[str, Any]:
    """The document of an estimate; versions : the baseline, and the version of ``--with``."""
    from aerodb.flows.cli.flights import called
    from aerodb.flows.estimate import estimate_flow
    from aerodb.identification import chosen_methods, declares_state_space
    from aerodb.tasks.steps import is_on_ground

    catalogue = session.catalogue()
    name = catalogue.vehicle(vehicle).name
    baseline, beside = versions
    if baseline == "none" and beside is not None:
        raise InputError("--with is beside a version", "--baseline none", "leave it out")
    version = None if baseline == "none" else catalogue.version(name, baseline).id
    other = beside_of(catalogue, name, beside)
    rolls = version is not None and is_on_ground(
        version, model, workspace=str(session.root), **other
    )
    methods = methods or ["output-error" if rolls else "regression"]
    rows = (
        [catalogue.flight(ref, name) for ref in flights]
        if flights
        else [
            row
            for row in catalogue.flights(name)
            if row.verdict != "rejected" or (rolls and row.retracted_utc is None)
        ]
    )
    if not rows:
        raise InputError(
            "no flight can be used", f"vehicle {name}", f"aerodb flight list --vehicle {name}"
        )
    document: dict[str, Any] = session.run(
        estimate_flow,
        {
            "flights": [row.id for row in rows],
            "model": model,
            "methods": [
                each.name for each in chosen_methods(methods, linear=declares_state_space(model))
            ],
            "version": version,
            "whole": whole,
            "page": page,
            "select": select,
            **other,
        },
        direct=True,
    )
    limited = [
        called(row, catalogue.log(row.log_sha256)) for row in rows if row.verdict == "limited"
    ]
    return {**document, "rolls": rolls, "limited": limited}


def _print(
    session: Session, document: dict[str, Any], report: bool, verbose: bool, then: str
) -> None:
    """Print which method to believe and why, and the estimates; with `verbose` also what each
    method assumes, and what speaks against single estimates."""
    given = [entry for entry in document["methods"] if "reason" not in entry]
    rows = [row for row in document["parameters"] if not row["parameter"].startswith(_OF_RECORDS)]
    reasons = document["reasons"]
    more = f" (and {len(reasons) - 1} more: -v)" if len(reasons) > 1 and not verbose else ""
    failed = [f"{e['method']}: {e['reason']}" for e in document["methods"] if "reason" in e]
    session.headlines(
        _verdict(document, [entry["method"] for entry in given], len(rows)),
        [
            ("known best", _known_best(given, document["believe"])),
            ("because", f"{reasons[0]}{more}" if reasons else ""),
            ("no estimate", "; ".join(failed)),
            ("limited", _limited(document.get("limited", []))),
            ("left out", _left_out(document.get("left_out", {}))),
            ("selected", " and ".join(document.get("select", ()))),
        ],
        then if document["believe"] else "",
    )
    for entry in given if report else ():
        session.say(entry["report"])
        session.say()
    if not given:
        return
    session.say()
    _print_estimates(session, rows, [entry["method"] for entry in given])
    for entry in given:
        if entry.get("modes"):
            session.say()
            session.say(f"modes by {entry['method']}")
            print_modes(session, entry["modes"])
    if not verbose:
        session.say("assumptions, and what speaks against single estimates: -v; p-values: --report")
        return
    for entry in given:
        for each in entry["estimates"]:
            if each["reason"] and each["standing"] not in ("fixed", "tied"):
                session.say(
                    f"{each['name']} by {entry['method']}: {each['standing']}, {each['reason']}"
                )
    for each in document.get("records", ()):
        session.say(f"record {each['record']}: {each['seconds']:.4g} s at {each['rate']:.4g} Hz")
    for note in document.get("notes", ()):
        session.say(f"- {note}")
    session.say()
    for entry in given:
        for axis, each in entry["axes"].items():
            explained = f"R2 {each['r_squared']:.3f}" if each["r_squared"] is not None else "still"
            session.say(f"{axis} by {entry['method']}: error {each['error']:.4g}, {explained}")
        session.say(f"{entry['method']} assumes: {' '.join(entry['assumes'])}")
        for note in entry["notes"]:
            session.say(f"- {note}")
    session.say()
    for reason in reasons:
        session.say(f"- {reason}")


def _verdict(document: dict[str, Any], names: list[str], count: int) -> str:
    """Return which of several methods to believe, or how many parameters one gave."""
    if not names:
        return "no method gave an estimate"
    if len(names) == 1:
        return f"{counted(count, 'parameter')} by {names[0]}"
    if document["believe"]:
        reserved = ", with reservation" if document["reserved"] else ""
        return f"believe here: {document['believe']}{reserved} ({counted(count, 'parameter')})"
    if document["preferred"]:
        least = document["preferred"]
        return f"believe here: none; the least doubtful is {least} ({counted(count, 'parameter')})"
    return f"believe here: none ({counted(count, 'parameter')})"


def _limited(flights: list[str]) -> str:
    """Return which flights are used with reservations; empty where none is."""
    if not flights:
        return ""
    more = f" and {len(flights) - _NAMED} more" if len(flights) > _NAMED else ""
    named = ", ".join(flights[:_NAMED])
    return f"{named}{more}: used, with reservations (why: aerodb flight show {flights[0]})"


def _left_out(reasons: dict[str, str]) -> str:
    """Return whose rolls are not used, and why those of the first are not; empty where all are."""
    if not reasons:
        return ""
    flight, reason = next(iter(reasons.items()))
    more = f" and {len(reasons) - 1} more" if len(reasons) > 1 else ""
    return f"{flight[:12]}{more}: {reason}"


def _known_best(given: list[dict[str, Any]], believed: str | None) -> str:
    """Return the estimate that is the most of its standard errors from zero, of the method that is
    believed, +- half of its 95 % interval; empty where none is. Where a record began is none."""
    known = [
        each
        for entry in given
        for each in entry["estimates"]
        if entry["method"] == believed
        and each["standard_error"]
        and not each["name"].startswith(_OF_RECORDS)
    ]
    if not known:
        return ""
    best = max(known, key=lambda each: abs(float(each["value"])) / float(each["standard_error"]))
    return f"{best['name']} {plus_minus(best['value'], best['standard_error'])}"


def _print_estimates(session: Session, rows: list[dict[str, Any]], names: list[str]) -> None:
    """Print the estimates of several methods beside each other."""
    several = len(names) > 1
    if len(names) > _SIDE_BY_SIDE:
        _print_long(session, rows, names)
    else:
        session.table(
            ["parameter", *names, *(["spread"] if several else [])],
            [
                [
                    row["parameter"],
                    *(_cell(row["estimates"].get(name)) for name in names),
                    *([_spread(row)] if several else []),
                ]
                for row in rows
            ],
            numbers=tuple(range(1, len(names) + 1 + several)),
        )
    spread = "; spread: largest difference in standard errors" if several else ""
    session.say(f"{HALF_INTERVAL}{spread}")


def _print_long(session: Session, rows: list[dict[str, Any]], names: list[str]) -> None:
    """One line per parameter and method: more methods than fit side by side."""
    lines = []
    for row in rows:
        for k, name in enumerate(name for name in names if name in row["estimates"]):
            first = [row["parameter"], _spread(row)] if k == 0 else ["", ""]
            lines.append([first[0], name, _cell(row["estimates"][name]), first[1]])
    session.table(["parameter", "method", "estimate", "spread"], lines, numbers=(3,))


def _cell(entry: dict[str, Any] | None) -> str:
    if entry is None:
        return "-"
    if entry["value"] is None:
        return str(entry["standing"])
    text = plus_minus(entry["value"], entry["standard_error"])
    return text if entry["standing"] == "estimated" else f"{text} ({entry['standing']})"


def _spread(row: dict[str, Any]) -> str:
    return "-" if row["spread"] is None else f"{row['spread']:.1f}"
