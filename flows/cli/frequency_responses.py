"""``aerodb flight frequency-response``: coherence, and a low-order transfer function."""

from math import degrees, log10
from typing import Annotated, Any

import typer

from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import Since, Until, Vehicle, stretch_of


def frequency_response(
    context: typer.Context,
    flight: str,
    driven_by: Annotated[
        list[str],
        typer.Option("--input", help="Channel; further ones that move with it, repeated."),
    ],
    output: Annotated[str, typer.Option(help="Channel that responds.")],
    zeros: Annotated[
        list[int] | None, typer.Option(help="Factors of the numerator: 1 real, 2 a pair.")
    ] = None,
    poles: Annotated[
        list[int] | None, typer.Option(help="Factors of the denominator; default: a pair.")
    ] = None,
    delay: Annotated[bool, typer.Option(help="Whether there is a delay.")] = True,
    since: Since = None,
    until: Until = None,
    lowest: Annotated[float | None, typer.Option(help="Lowest frequency [rad/s].")] = None,
    highest: Annotated[float | None, typer.Option(help="Highest frequency [rad/s].")] = None,
    vehicle: Vehicle = None,
) -> None:
    """Frequency response of a channel with its coherence, conditioned on further inputs, and a
    transfer function with a delay fitted to it.

    Example: aerodb flight frequency-response 1a2b3c --input delta_elevator --output q --zeros 1
    --poles 2
    """
    from aerodb.flows.frequency_response import frequency_response_flow

    session: Session = context.obj
    row = session.catalogue().flight(flight, vehicle)
    document = session.run(
        frequency_response_flow,
        {
            "flight": row.id,
            "inputs": driven_by,
            "output": output,
            "zeros": zeros or [],
            "poles": poles or [2],
            "delay": delay,
            **stretch_of(row, since, until),
            "lowest": lowest,
            "highest": highest,
        },
        direct=True,
    )
    _say(session, document)
    session.answer(document)


def _say(session: Session, document: dict[str, Any]) -> None:
    others = f", without {', '.join(document['others'])}" if document["others"] else ""
    session.say(f"{document['output']} per {document['input']}{others}")
    session.table(
        ["rad/s", "dB", "phase deg", "coherence", "random error", ""],
        [
            [
                f"{row['omega']:.3g}",
                "-" if not row["magnitude"] else f"{20.0 * log10(row['magnitude']):.1f}",
                f"{degrees(row['phase']):.0f}",
                f"{row['coherence']:.2f}",
                "-" if row["random_error"] is None else f"{row['random_error']:.0%}",
                "" if row["used"] else "not used",
            ]
            for row in document["frequencies"][::4]
        ],
        range(5),
    )
    session.say()
    session.table(
        ["parameter", "estimate", "standard error", "unit", "standing", ""],
        [
            [
                row["name"],
                "-" if row["value"] is None else f"{row['value']:.4g}",
                "-" if row["standard_error"] is None else f"{row['standard_error']:.2g}",
                row["unit"],
                row["standing"],
                row["reason"],
            ]
            for row in document["estimates"]
        ],
        (1, 2),
    )
    for note in document["notes"]:
        session.say(f"- {note}")
