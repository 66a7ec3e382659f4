"""Options that commands about versions share; see `aerodb.tasks.references` for their meaning."""

from typing import Annotated

import typer

Vehicle = Annotated[str | None, typer.Option(help="The vehicle; optional if there is only one.")]
AsOf = Annotated[
    str | None, typer.Option("--as-of", help="As it was at this date (ISO 8601, UTC).")
]
