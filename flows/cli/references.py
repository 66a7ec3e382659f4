"""Options that commands share; `aerodb.tasks.references` says what those about versions mean."""

from typing import Annotated

import typer

from aerodb.flows.cli.output import begin_server

Vehicle = Annotated[str | None, typer.Option(help="The vehicle; optional if there is only one.")]
AsOf = Annotated[
    str | None, typer.Option("--as-of", help="As it was at this date (ISO 8601, UTC).")
]
OfFlight = Annotated[
    str | None, typer.Option(help="The vehicle, if several flights have this name.")
]
Direct = Annotated[
    bool,
    typer.Option(callback=begin_server, help="Run without Prefect; steps and keys are the same."),
]
Flights = Annotated[
    list[str] | None, typer.Option(help="Flights to use; default: all of the vehicle.")
]
HoldOut = Annotated[
    list[str] | None,
    typer.Option(
        help="Flights to hold out (the search does not see them, they check it), or `none`;"
        " default: the newest fifth."
    ),
]
Select = Annotated[
    list[str] | None,
    typer.Option(
        help="Condition of the samples that count, such as `command_1 > 0.3`, `time < 20 s` or"
        " `phase = hover`; repeat the option: all hold."
    ),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Also print the details.")]
MappingFile = Annotated[
    str | None, typer.Option(help="Name or file of a mapping; default: chosen by content.")
]
