"""The application: global options, commands, and exit codes of errors."""

import gc
import os
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from aerodb.errors import AeroError, GateRefusal, InputError, OpenQuestionsError, UnknownNameError
from aerodb.flows.cli import (
    backing_out,
    calibrations,
    closing,
    databases,
    demonstration,
    derivatives,
    designing,
    differences,
    estimating,
    estimating_online,
    expanding,
    flights,
    frequency_responses,
    keeping,
    lineage,
    logs,
    mappings,
    moving_air,
    releases,
    reports,
    responses,
    schemas,
    serving,
    store,
    tabulating,
    trimming,
    updates,
    users,
    vehicles,
    versions,
    web,
)
from aerodb.flows.cli.groups import RootCommands
from aerodb.flows.cli.known_names import EFFECTS
from aerodb.flows.cli.output import UNITS_VARIABLE, Session, complaint, visible
from aerodb.support import require_supported_system

#: Exit code of a command that did what it was asked for.
DONE = 0
#: Exit code of a failure that is no fault of the input: a bug, or the machine.
FAILED = 1
#: Exit code of a wrong command line, as shells and click have it.
USAGE = 2
#: Exit code of an input that cannot be used.
REFUSED = 3
#: Exit code of a version that the promotion gate refuses.
GATE = 4

#: New objects between two searches for garbage: imports make hundreds of thousands, none garbage.
_OBJECTS = 50_000

app = typer.Typer(
    name="aerodb",
    cls=RootCommands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help=(
        "Keeps aerodynamic databases true to flight.\n\nExample: aerodb flight ingest log.ulg"
        " --vehicle my-glider"
    ),
)
flights.app.command("turbulence")(moving_air.turbulence)
flights.app.command("wake")(moving_air.wake)
flights.app.command("frequency-response")(frequency_responses.frequency_response)
versions.app.command("fly")(responses.fly)
versions.app.command("validate")(responses.validate)
versions.app.command("design")(designing.design)
versions.app.command("expand")(expanding.expand)
versions.app.command("lineage")(lineage.lineage)
versions.app.command("impact")(lineage.impact)
versions.app.command("diff")(differences.diff)
for query in (trimming.trim, trimming.modes, trimming.sweep):
    versions.app.command(query.__name__)(query)
versions.app.command("back-out")(backing_out.back_out)
versions.app.command("tabulate")(tabulating.tabulate)
versions.app.command("export")(releases.export)
versions.app.command("gate")(releases.gate)
versions.app.command("promote")(releases.promote)
versions.app.command("rollback")(releases.rollback)
for group in (
    vehicles.app,
    databases.app,
    mappings.app,
    logs.app,
    flights.app,
    versions.app,
    calibrations.app,
    reports.app,
    store.app,
    users.app,
):
    app.add_typer(group)
app.command("update")(updates.update)
app.command("estimate")(estimating.estimate)
app.command("derivatives")(derivatives.derivatives)
app.command("estimate-online")(estimating_online.estimate_online)
app.command("close-loop", epilog=f"Effects: {EFFECTS}.")(closing.close_loop)
app.command("recalibrate")(calibrations.recalibrate)
for command in (serving.serve, serving.nightly, serving.status, serving.retry, serving.dismiss):
    app.command(command.__name__)(command)
app.command("web")(web.web)
app.command("schema")(schemas.schema)
app.command("demo")(demonstration.demo)
app.command("verify")(keeping.verify)
app.command("backup")(keeping.backup)
app.command("restore")(keeping.restore)


def _say_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"aerodb {version('aerodb')}")
        raise typer.Exit


@app.callback()
def session(
    context: typer.Context,
    workspace: Annotated[
        Path | None,
        typer.Option(
            help="Workspace folder (catalogue and store).", show_default="./aerodb-workspace"
        ),
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="One JSON document on standard output.")
    ] = False,
    units: Annotated[
        str | None,
        typer.Option(
            help="Units of what is printed: si, aero (kt, ft) or imperial; JSON stays SI.",
            show_default="$AERODB_UNITS, [show] of the settings, or si",
        ),
    ] = None,
    debug: Annotated[bool, typer.Option(help="Show tracebacks.")] = False,
    _version: Annotated[
        bool,
        typer.Option(
            "--version", help="Say the version of aerodb.", is_eager=True, callback=_say_version
        ),
    ] = False,
) -> None:
    """Keep the options that all commands share."""
    root = workspace or Path(os.environ.get("AERODB_WORKSPACE") or "aerodb-workspace")
    chosen = units or os.environ.get(UNITS_VARIABLE, "")
    if chosen:
        from aerodb.units import UnitSystem

        UnitSystem(chosen)  # a command that prints no quantity refuses a wrong name, too
    context.obj = Session(root, json, debug, chosen)


def main() -> None:
    """Run the command line, and end the process with its exit code.

    Exit codes: docs/reference/contract.md, section "Exit codes".
    """
    debug = "--debug" in sys.argv
    gc.set_threshold(_OBJECTS)
    # The search for plugins reads the metadata of every package: 20 ms of each command.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Every step runs BLAS in one thread (`run.py`); its others only spin, from numpy's import on.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        require_supported_system()
        # Outside of its standalone mode the library returns the code of an Exit instead of raising
        # it.
        left_with = app(standalone_mode=False)
        code = left_with if isinstance(left_with, int) else DONE
    except typer.Abort:
        code = FAILED
    except AeroError as error:
        if debug:
            raise
        print(complaint(error.what, error.where, error.remedy), file=sys.stderr)
        for question in error.questions if isinstance(error, OpenQuestionsError) else ():
            for line in question.lines:
                print(visible(line), file=sys.stderr)
        code = _code(error)
    except Exception as error:
        if debug:
            raise
        code = _unexpected(error)
    sys.exit(code)


def _code(error: AeroError) -> int:
    if isinstance(error, GateRefusal):
        return GATE
    if isinstance(error, UnknownNameError):
        return USAGE
    return REFUSED if isinstance(error, InputError) else FAILED


def _unexpected(error: Exception) -> int:
    # Errors of usage come from the library below typer, which has no public name for their common
    # class.
    show = getattr(error, "show", None)
    if callable(show):
        show()
        command = getattr(getattr(error, "ctx", None), "command", None)
        page = "" if hasattr(command, "commands") else getattr(command, "help", None) or ""
        for part in page.split("\n\n"):
            if (words := part.split())[:1] == ["Example:"]:
                print(" ".join(words), file=sys.stderr)
        return int(getattr(error, "exit_code", USAGE))
    if isinstance(error, OverflowError) and not _tells_time():
        what = "its clock is after the year 2262, where Python's time ends"
        print(complaint(what, "this computer", "set the clock"), file=sys.stderr)
        return FAILED
    print(
        f"aerodb: {type(error).__name__}: {error}\nthis is a bug in aerodb; run again with"
        " --debug and report it",
        file=sys.stderr,
    )
    return FAILED


def _tells_time() -> bool:
    try:
        time.time()
    except OverflowError:
        return False
    return True
