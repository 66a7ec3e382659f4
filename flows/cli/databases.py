"""``aerodb database``: import a baseline from a file, and what it needs of flights."""

import math
import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from aerodb.errors import InputError, Question
from aerodb.flows.cli.asking import ask, can_ask
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.known_names import DATABASES
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import Vehicle

app = typer.Typer(
    name="database", cls=Commands, no_args_is_help=True, help="Baseline databases from files."
)


@app.command("import")
def import_file(
    context: typer.Context,
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help=f"{DATABASES}; several of one code make tables, a TOML file joins the one before.",
        ),
    ],
    vehicle: Annotated[
        str | None,
        typer.Option(help="The vehicle that it describes; optional if there is only one."),
    ] = None,
    bind: Annotated[
        list[str] | None,
        typer.Option(
            help="Definition of an unknown input of the file: NAME=EXPRESSION over channels."
        ),
    ] = None,
    accept_proposals: Annotated[
        bool,
        typer.Option(
            "--accept-proposals",
            help="Hold at zero what the file needs and no flight has; the version keeps a record.",
        ),
    ] = False,
    replace: Annotated[
        bool,
        typer.Option("--replace", help="Release it in place of the released import; --reason too."),
    ] = False,
    reason: Annotated[
        str, typer.Option(help="Why it replaces the released import; stored with the move.")
    ] = "",
    accept: Annotated[
        list[str] | None,
        typer.Option(
            help="With --replace: `file_checks` releases a file whose own check cases fail."
        ),
    ] = None,
) -> None:
    """Import a database file as a version, and run the check cases that the file brings along.

    A vehicle's first import becomes `released`, and so does the same file imported again before
    anything was made of it; not so if check cases of the file fail. A wrong import is replaced by
    the right one with --replace and --reason. On a terminal, inputs that are not known are asked
    for, with proposals; elsewhere, and with --json, they are listed.

    Example: aerodb database import cruise.st climb.st --vehicle my-glider --bind length_unit=m
    """
    from aerodb.flows.importing import import_flow
    from aerodb.tasks.references import vehicle_of

    session: Session = context.obj
    for each in files:
        if not each.is_file():
            raise InputError("no such file", str(each), "check the path")
    if replace and not reason.strip():
        raise InputError("replacing the released import requires a reason", "", "--reason TEXT")
    if accept and not replace:
        raise InputError("--accept concerns the release", "", "add --replace and --reason")
    bindings = dict(_binding(text) for text in bind or [])
    vehicle = vehicle_of(session.catalogue(), vehicle)
    parameters = {
        "file": str(files[0]),
        "vehicle": vehicle,
        "bindings": bindings,
        "accept_proposals": accept_proposals,
        "replace_reason": reason if replace else "",
        "accept": accept or [],
        "further": [str(each) for each in files[1:]],
    }
    document = _imported(session, import_flow, parameters)
    because, then = _standing(document, vehicle)
    session.headlines(
        f"{vehicle}: {document['label']} is {'stored, not ' if because else ''}released"
        f" ({document['database']}, {document['version'][:12]})",
        [
            ("because", because),
            ("instead of", document["replaced"] or ""),
            ("lacks", ", ".join(document["lacks"])),
        ],
        then,
    )
    _say_content(session, document)
    _say_checks(session, document)
    _say_values(session, document)
    _say_inputs(session, document)
    if document["lacking"]:
        zeros = "" if document["dividing"] else "to take all zeros: --accept-proposals; "
        session.say(f"{zeros}to choose, copy and edit:")
        session.say(_command(files, vehicle, bind or [], document))
    session.answer(document)


def _imported(session: Session, flow: Any, parameters: dict[str, Any]) -> dict[str, Any]:
    """Run the import; on a terminal, ask what is open before anything is stored."""
    if not can_ask(session):
        document: dict[str, Any] = session.run(flow, parameters, direct=True)
        return document
    bindings: dict[str, str] = parameters["bindings"]
    given = dict(bindings)
    while True:
        document = session.run(flow, {**parameters, "ask": True}, direct=True)
        if "questions" not in document:
            break
        bindings.update(ask([Question(**each) for each in document["questions"]]))
    answered = {name: text for name, text in bindings.items() if given.get(name) != text}
    if answered:
        options = " ".join(f"--bind {shlex.quote(f'{n}={e}')}" for n, e in answered.items())
        session.say(f"bound as with: {options}")
    return document


@app.command("inputs")
def inputs(
    context: typer.Context,
    version: Annotated[str, typer.Argument(help="The version.")] = "released",
    vehicle: Vehicle = None,
) -> None:
    """Say what a version needs, what no flight has, what is proposed for it, and what it changes.

    Example: aerodb database inputs released --vehicle twin-otter
    """
    from aerodb.flows.importing import inputs_flow
    from aerodb.tasks.references import version_of

    session: Session = context.obj
    row = version_of(session.catalogue(), version, vehicle)
    parameters = {"version": row.id, "vehicle": row.vehicle}
    document = session.run(inputs_flow, parameters, direct=True)
    _say_inputs(session, document)
    session.answer(document)


def _standing(document: dict[str, Any], vehicle: str) -> tuple[str, str]:
    """Return why an import is not released (empty where it is), and the next command."""
    label, checks = document["label"], document["file_checks"]
    promote = f"aerodb version promote {label} --vehicle {vehicle}"
    if document["dividing"]:
        names = ", ".join(document["written"][name] for name in document["dividing"])
        return f"it divides by {names}, which no flight has", ""  # the command stands below
    if document["released"]:
        then = "" if document["lacking"] else f"aerodb flight ingest LOG --vehicle {vehicle}"
        return "", then
    if document["without_values"]:
        names = ", ".join(document["without_values"])
        has = "has" if len(document["without_values"]) == 1 else "have"
        return (
            f"{names} {has} no finite value at some points of usual flight: bind what divides it",
            f"aerodb database inputs {label} --vehicle {vehicle}",
        )
    if checks is not None and not checks["passed"]:
        return "its own check cases fail", f'{promote} --accept file_checks --reason "..."'
    if document["unusual"]:
        return "it has what no aircraft has", f'{promote} --accept content --reason "..."'
    return f"another one is; build on this with --baseline {label}", f'{promote} --reason "..."'


def _say_content(session: Session, document: dict[str, Any]) -> None:
    """Print how a file of a code was read, and the curves of the database."""
    for line in document["read_as"]:
        session.say(f"- {line}")
    found = document["curves"]
    if found and document["read_as"]:
        degrees = [math.degrees(x) for x in found["alpha"]]
        session.say("alpha [deg] " + " ".join(f"{x:8.3g}" for x in degrees))
        for axis in ("C_lift", "C_drag", "Cm"):
            session.say(f"{axis:<11} " + " ".join(f"{x:8.4f}" for x in found[axis]))
        session.say(f"curves: aerodb report version {document['label']} --output curves.html")


def _say_checks(session: Session, document: dict[str, Any]) -> None:
    checks = document["file_checks"]
    if checks is None:
        return
    session.say(("" if checks["passed"] else "WARNING: ") + checks["sentence"])
    for failure in checks["failures"][:5]:
        session.say(f"- {failure}")
    if checks["failed"] > 5:
        session.say(f"- and {checks['failed'] - 5} more: aerodb --json version show")


def _say_values(session: Session, document: dict[str, Any]) -> None:
    """Warn of values that no aircraft has."""
    for sentence in document["unusual"]:
        session.say(f"WARNING: {sentence}")


def _command(files: list[Path], vehicle: str, bind: list[str], document: dict[str, Any]) -> str:
    """The whole command with a binding per input that no flight has, to be edited."""
    given = [
        *bind,
        *(texts[0] for texts in document["proposals"].values() if texts),
        *(f"{document['written'][name]}=NUMBER" for name in document["dividing"]),
    ]
    named = " ".join(shlex.quote(str(each)) for each in files)
    lines = [f"aerodb database import {named} --vehicle {shlex.quote(vehicle)}"]
    return " \\\n".join([*lines, *(f"  --bind {shlex.quote(text)}" for text in given)])


def _say_inputs(session: Session, document: dict[str, Any]) -> None:
    """Print inputs, and a proposal for each that no flight has."""
    for warning in document["warnings"]:
        session.say(f"WARNING: {warning['sentence']}")
    written = document["written"]
    session.say(f"needs: {', '.join(written[each] for each in document['inputs']) or 'nothing'}")
    for name in document["required"]:
        session.say(f"- no flight has {name}, which nothing can stand for: map it from the log")
    for use in document["uses"]:
        divides = use["name"] in document["dividing"]
        if divides:
            session.say(
                f"- no flight has {use['source']}, and the database divides by it: not released;"
                f" state its value: --bind {use['written']}=NUMBER"
            )
        else:
            session.say(f"- {'' if use['accepted'] else 'no flight has '}{use['sentence']}")
        if not use["accepted"]:
            if not divides:
                session.say(f"  proposed: zero: {_zero(use)}")
            for text in document["proposals"].get(use["name"], ())[: None if divides else -1]:
                session.say(f"  or, if that is meant: --bind {text}")
        for each in use["residuals"]:
            if each["with_zero"] < each["now"]:
                session.say(f"  on {each['axis']} the flights speak for zero: {_zero(use)}")


def _zero(use: dict[str, Any]) -> str:
    """What a user writes to hold an input at zero.

    >>> _zero({"written": "fcs/flap-pos-norm", "channel": ""})
    '--bind fcs/flap-pos-norm=0'
    """
    if use["channel"]:
        channel = use["channel"]
        return f'"{channel} = 0.0" in [configuration] of the vehicle file before ingestion'
    return f"--bind {use['written']}=0"


def _binding(text: str) -> tuple[str, str]:
    name, sign, expression = text.partition("=")
    if not sign or not name.strip() or not expression.strip():
        raise InputError(
            f"'{text}' is not NAME=EXPRESSION",
            "--bind",
            "for example --bind gear/gear-pos-norm=delta_landing_gear",
        )
    return name.strip(), expression.strip()
