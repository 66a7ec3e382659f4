"""``aerodb version fly`` and ``validate``: versions flown over recorded flights."""

from pathlib import Path
from typing import Annotated, Any, Final

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session, plus_minus
from aerodb.flows.cli.references import (
    Beside,
    Since,
    Until,
    Vehicle,
    Verbose,
    beside_of,
    stretch_of,
)
from aerodb.support import counted

#: Most checks that a line names.
_NAMED: Final = 3

Tolerances = Annotated[
    Path | None,
    typer.Option(
        help="Tolerances as TOML, engine-failure (of a take-off), or normal-landing; default: 14"
        " CFR 60 appendix A."
    ),
]
Wind = Annotated[str, typer.Option(help="measured: gusts as reconstructed; mean: of each stretch.")]
Stabilise = Annotated[
    bool,
    typer.Option(help="Close the least stabilising feedback where the vehicle is unstable."),
]
Trimmed = Annotated[
    bool,
    typer.Option(
        help="Begin in the flight's trim: a constant force and moment hold the first second."
    ),
]
Output = Annotated[
    Path | None,
    typer.Option(help="Page (HTML, or PDF) to write, with each response beside the flight."),
]


def fly(
    context: typer.Context,
    version: str,
    flight: Annotated[str | None, typer.Option(help="The flight.")] = None,
    manoeuvre: Annotated[
        Path | None, typer.Option(help="A described manoeuvre as TOML, in place of a flight.")
    ] = None,
    since: Since = None,
    until: Until = None,
    wind: Wind = "measured",
    stabilise: Stabilise = True,
    feedback: Annotated[
        list[str] | None,
        typer.Option(help="INPUT:CHANNEL=GAIN on flown - simulated, for example delta_e:q=0.3."),
    ] = None,
    trimmed: Trimmed = False,
    tolerances: Tolerances = None,
    output: Output = None,
    beside: Beside = None,
    vehicle: Vehicle = None,
    verbose: Verbose = False,
) -> None:
    """Fly a version from the flight's start under its inputs; each manoeuvre, or --from --to. Or
    through a described manoeuvre, from trim.

    Example: aerodb version fly candidate --flight 1a2b3c --output responses.html
    """
    from aerodb.flows.fly import fly_flow
    from aerodb.tasks.references import version_of

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle)
    if (flight is None) == (manoeuvre is None):
        raise InputError("name a flight or a manoeuvre", remedy="--flight F, or --manoeuvre FILE")
    if manoeuvre is not None:
        other = beside_of(catalogue, row.vehicle, beside)
        _fly_manoeuvre(session, row, manoeuvre, stabilise, output, other)
        return
    flown = catalogue.flight(str(flight), row.vehicle)
    parameters: dict[str, Any] = {
        "version": row.id,
        "flight": flown.id,
        **stretch_of(flown, since, until),
        "wind": wind,
        "stabilise": stabilise,
        "feedback": dict(_gain(text) for text in feedback or []),
        "trimmed": trimmed,
        "tolerances": _text(tolerances),
        "page": output is not None,
        **beside_of(catalogue, row.vehicle, beside),
    }
    document = session.run(fly_flow, parameters, direct=True)
    page = document.pop("page", None)
    name = catalogue.flight_labels([document["flight"]])[document["flight"]]
    session.headlines(
        f"{row.vehicle}: {row.label} over {name}: {_flown_words(document)}",
        [("outside", _outside_words(document)), ("feedback", _feedback_words(session, document))],
        f"aerodb version validate {row.label}{_with(beside)} --vehicle {row.vehicle}",
    )
    session.say()
    if verbose:
        _say_details(session, document)
    else:
        _say_stretches(session, document)
    _write(session, output, page)
    session.answer(document)


def _fly_manoeuvre(
    session: Session,
    row: Any,
    file: Path,
    stabilise: bool,
    output: Path | None,
    beside: dict[str, str],
) -> None:
    from aerodb.flows.fly import manoeuvre_flow
    from aerodb.report import channel_scale

    parameters = {
        "version": row.id,
        "manoeuvre": _text(file),
        "stabilise": stabilise,
        "page": output is not None,
        **beside,
    }
    document = session.run(manoeuvre_flow, parameters, direct=True)
    page = document.pop("page", None)
    session.say(
        f"version {row.label} flown through {document['manoeuvre']}, {document['ended']:.1f} s"
    )
    rows = []
    for name, (start, least, greatest) in document["responses"].items():
        factor, label = channel_scale(name, session.units)
        rows.append([label, *(f"{factor * value + 0.0:.4g}" for value in (start, least, greatest))])
    session.table(["response", "trim", "least", "greatest"], rows, (1, 2, 3))
    for note in document["notes"]:
        session.say(note)
    _write(session, output, page)
    session.answer(document)


def validate(
    context: typer.Context,
    version: str,
    flight: Annotated[
        list[str] | None,
        typer.Option(help="Flights; default: those that the version has not seen (held out)."),
    ] = None,
    against: Annotated[
        str, typer.Option(help="Version flown beside it: parent, none, or a version.")
    ] = "parent",
    wind: Wind = "measured",
    stabilise: Stabilise = True,
    trimmed: Trimmed = False,
    tolerances: Tolerances = None,
    output: Output = None,
    table: Annotated[
        Path | None, typer.Option(help="CSV file to write: the qualification table for a QTG.")
    ] = None,
    beside: Beside = None,
    vehicle: Vehicle = None,
    verbose: Verbose = False,
) -> None:
    """Fly a version and its baseline over the manoeuvres of its held-out flights, and judge the
    responses. Exits with 4 where a check fails.

    Example: aerodb version validate candidate --output responses.html --table qualification.csv
    """
    from aerodb.flows.fly import validate_flow
    from aerodb.tasks.references import flights_to_judge, version_of

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle)
    flights, independent = flights_to_judge(catalogue, row, flight or ())
    baseline = None
    if against == "parent":
        baseline = row.parent
    elif against != "none":
        baseline = version_of(catalogue, against, vehicle).id
    parameters = {
        "version": row.id,
        "baseline": baseline,
        "flights": flights,
        "independent": independent,
        "wind": wind,
        "stabilise": stabilise,
        "trimmed": trimmed,
        "tolerances": _text(tolerances),
        "page": output is not None,
        **beside_of(catalogue, row.vehicle, beside),
    }
    document = session.run(validate_flow, parameters, direct=True)
    page = document.pop("page", None)
    then = f"aerodb version gate {row.label} --vehicle {row.vehicle}"
    say_responses(session, row.label, document, verbose, then)
    _write(session, output, page)
    if table is not None:
        from aerodb.report import qualification_csv
        from aerodb.storage.workspace import write_for_user

        beside = catalogue.version_of_id(baseline).label if baseline else ""
        text = qualification_csv(document, row.label, beside)
        written = write_for_user(session.workspace(), table, text.encode("utf-8"))
        session.say(f"wrote {written}")
    session.answer(document)
    if not document["passed"]:
        raise typer.Exit(4)


def _with(beside: str | None) -> str:
    return f" --with {beside}" if beside else ""


def _gain(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise InputError(
            f"'{text}' is no feedback", remedy="write INPUT:CHANNEL=GAIN, as delta_e:q=0.3"
        ) from None


def _text(path: Path | None) -> str:
    from aerodb.tasks.steps import read_tolerances

    return "" if path is None else read_tolerances(path)


def _write(session: Session, output: Path | None, page: str | None) -> None:
    if output is not None and page is not None:
        session.write_page(output, page)


def _outside_words(document: dict[str, Any]) -> str:
    """Return which checks are outside tolerance, the worst first."""
    failed: dict[str, float] = {}
    for stretch in document["stretches"]:
        for check in stretch.get("checks", ()):
            if not check["passed"]:
                failed[check["check"]] = min(check["share"], failed.get(check["check"], 1.0))
    worst = sorted(failed, key=lambda name: failed[name])[:_NAMED]
    return "; ".join(f"{name} (inside {failed[name]:.0%} of the time)" for name in worst)


def _feedback_words(session: Session, document: dict[str, Any]) -> str:
    """Return in how many stretches feedback was closed, and by how much it moved a control."""
    from aerodb.report import closed_words

    flown = [stretch for stretch in document["stretches"] if "reason" not in stretch]
    closed = [stretch["correction"] for stretch in flown if stretch["correction"]]
    if not closed:
        return ""
    largest = max(max(each.values()) for each in closed)
    return closed_words(len(closed), len(flown), "stretches", largest, session.units)


def _say_stretches(session: Session, document: dict[str, Any]) -> None:
    """Print a line per stretch: what was flown, checks within tolerance, the correction by
    feedback."""
    rows, why = [], []
    for stretch in document["stretches"]:
        where = f"{stretch['since']:.1f} to {stretch['until']:.1f} s"
        if "reason" in stretch:
            rows.append([where, stretch["kind"].replace("_", " "), "", "not flown", ""])
            why.append(f"not flown: {where}: {stretch.get('what', stretch['reason'])}")
            continue
        passed = [check["passed"] for check in stretch["checks"]]
        moved = max(stretch["correction"].values(), default=0.0)
        rows.append(
            [
                where,
                stretch["kind"].replace("_", " "),
                ", ".join(stretch["controls"]),
                f"{sum(passed)} of {len(passed)}" if passed else "not judged",
                session.units.shown(moved, "rad", 2) if moved else "",
            ]
        )
    session.table(["stretch", "flown", "moves", "within tolerance", "feedback"], rows)
    for sentence in why:
        session.say(sentence)
    session.say("responses and checks of each stretch: -v")


def _say_details(session: Session, document: dict[str, Any]) -> None:
    for stretch in document["stretches"]:
        session.say()
        where = f"{stretch['since']:.1f} to {stretch['until']:.1f} s, {stretch['kind']}"
        if "reason" in stretch:
            session.say(f"{where}: not flown: {stretch['reason']}")
            continue
        session.say(f"{where} ({', '.join(stretch['controls']) or 'no control moved'})")
        if stretch["correction"]:
            largest = max(stretch["correction"], key=stretch["correction"].__getitem__)
            moved = session.units.shown(stretch["correction"][largest], "rad", 2)
            session.say(
                "  unstable: least stabilising feedback closed; it moved"
                f" {largest} by up to {moved}"
            )
        for check in stretch["checks"]:
            word = "within" if check["passed"] else "OUTSIDE"
            session.say(f"  {word}: {check['check']}: {check['share']:.0%} of the time inside")
        session.table(
            ["response", "rms of flight", "rms error", "fit", "bias", "variance", "covariance"],
            [_row(session, response) for response in stretch["responses"]],
            range(1, 7),
        )
        for name, swing in stretch["oscillations"].items():
            told = [
                f"{who} period {each['period']:.2f} s,"
                f" zeta {plus_minus(each['zeta'], each['sigma_zeta'], 3)}"
                for who, each in (("flight", swing["flown"]), ("version", swing["simulated"]))
                if each is not None
            ]
            session.say(f"  oscillation of {name}: {'; '.join(told)}")
        for note in stretch["notes"]:
            session.say(f"  {note}")


def _row(session: Session, response: dict[str, Any], *more: str) -> list[str]:
    from aerodb.report import channel_scale

    factor, label = channel_scale(response["channel"], session.units)
    theil = response["theil"]
    return [
        label,
        f"{factor * response['rms_flown']:.3g}",
        f"{factor * response['rms_error']:.3g}",
        *more,
        f"{theil['fit_percent']:.0f} %",
        *(f"{theil[part]:.2f}" for part in ("bias", "variance", "covariance")),
    ]


def _swing(found: dict[str, float] | None) -> tuple[str, str]:
    if found is None:
        return "", ""
    return f"{found['period']:.2f} s", f"zeta {plus_minus(found['zeta'], found['sigma_zeta'], 3)}"


def _flown_words(document: dict[str, Any]) -> str:
    """Return how many checks of the stretches are within tolerance, and how many were not flown."""
    flown = [stretch for stretch in document["stretches"] if "reason" not in stretch]
    checks = [check["passed"] for stretch in flown for check in stretch["checks"]]
    left = len(document["stretches"]) - len(flown)
    words = f"{sum(checks)} of {len(checks)} checks within tolerance"
    return f"{words}; {left} of {len(document['stretches'])} stretches not flown" if left else words


def _within_words(document: dict[str, Any]) -> str:
    """Return how many checks are within tolerance, or why nothing was judged."""
    from aerodb.report import count_within

    if document["checks"]:
        words = f"checks within tolerance: {count_within(document)}"
        alone = document["feedback"]
        if alone:
            words += f"; feedback closed (open loop: {alone['passed']} of {alone['checks']})"
        return words
    if document["manoeuvres"]:
        return "nothing is judged: the tolerances name no manoeuvre of these flights"
    why = [entry["what"] for entry in document["not_flown"]]
    return f"nothing is judged: {why[0] if why else 'these flights have no manoeuvre'}"


def _remedy(document: dict[str, Any]) -> str:
    """Return what the first stretch that was not flown asks for."""
    remedies = [entry["remedy"] for entry in document["not_flown"]]
    return next(filter(None, remedies), "hold out flights with manoeuvres")


def _not_flown(entries: list[dict[str, Any]], verbose: bool) -> str:
    """How many stretches were not flown, and where it is said why."""
    told = f"{len(entries)} stretch{'es' * (len(entries) != 1)}"
    return f"{told}{'' if verbose else ' (why: -v)'}" if entries else ""


def say_responses(
    session: Session,
    label: str,
    document: dict[str, Any],
    verbose: bool = False,
    then: str = "",
) -> None:
    """Print the summary of `validate_flow` for a version of this label; without `verbose` the
    tolerances alone. then : the next command, where something was flown."""
    from aerodb.report import channel_scale, feedback_lines, uncovered_numbers

    held = "held-out flight" if document["independent"] else "flight"
    kind = "" if document["independent"] else " that identified it"
    session.headlines(
        f"{label}: {_within_words(document)}",
        [
            (
                "flown",
                f"{counted(document['manoeuvres'], 'manoeuvre')} of"
                f" {counted(len(document['flights']), held)}{kind}; {document['tolerances']}",
            ),
            ("not covered", uncovered_numbers(document)),
        ],
        then if document["manoeuvres"] else _remedy(document),
        [
            *zip(("feedback", "open loop"), feedback_lines(document, session.units), strict=False),
            ("not flown", _not_flown(document["not_flown"], verbose)),
        ],
    )
    rows = []
    for check in document["checks"]:
        before = check["before"]
        rows.append(
            [
                check["check"],
                f"{check['passed']} of {check['manoeuvres']}",
                f"{check['share']:.0%}",
                f"{before['passed']} of {before['manoeuvres']}" if before else "",
                f"{before['share']:.0%}" if before and before["share"] is not None else "",
            ]
        )
    if rows:
        session.say()
        columns = ["check", "within tolerance", "of the time", "baseline", "of the time"]
        session.table(columns, rows, range(1, 5))
    for failed in document["failed"][:_NAMED]:
        session.say(
            f"outside: {failed['name']}, {failed['since']:.1f} to {failed['until']:.1f} s:"
            f" {failed['check']}, {failed['share']:.0%} of the time inside"
        )
    if len(document["failed"]) > _NAMED:
        session.say(f"and {len(document['failed']) - _NAMED} more: --json")
    if not verbose:
        if document["responses"]:
            session.say("errors of each response: -v")
        return
    if document["responses"]:
        session.say()
    told = [response for response in document["responses"] if response["manoeuvres"]]
    shown = []
    for response in told:
        factor = channel_scale(response["channel"], session.units)[0]
        before = response["before"]
        earlier, better = "", ""
        if before and before["manoeuvres"]:
            earlier = f"{factor * before['rms_error']:.3g}"
            better = f"{response['improved']} of {before['manoeuvres']}"
        shown.append(_row(session, response, earlier, better))
    columns = ["response", "rms of flight", "rms error", "baseline", "better in"]
    if shown:
        session.table([*columns, "fit", "bias", "variance", "covariance"], shown, range(1, 9))
    if document["oscillations"]:
        session.say()
        session.table(
            ["oscillation of", "flight", "", "version", "", "baseline", ""],
            [
                [each["channel"], *_swing(each["flown"]), *_swing(each["version"]),
                 *_swing(each["baseline"])]
                for each in document["oscillations"]
            ],
            range(1, 7),
        )  # fmt: skip
    for entry in document["not_flown"]:
        session.say(
            f"not flown: {entry['name']}, {entry['since']:.1f} to"
            f" {entry['until']:.1f} s: {entry['reason']}"
        )
