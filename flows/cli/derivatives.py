"""``aerodb derivatives``: dimensional derivatives to coefficients, and back."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.flows.cli.output import Session
from aerodb.flows.cli.vehicles import read_text

if TYPE_CHECKING:
    from aerodb.identification import Derivatives


def derivatives(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="File (TOML): flight condition and derivatives.")],
) -> None:
    """Convert the dimensional derivatives of a linear model (Lp, Nbeta, Zw) to those of
    coefficients, or the reverse, with standard errors; and what they say of its tails.

    Example: aerodb derivatives linear-model.toml
    """
    from aerodb.identification import converted, parse_derivative_file, tails_of

    session: Session = context.obj
    given = parse_derivative_file(read_text(file), str(file))
    rows = _rows([converted(given)])
    tails = _rows(tails_of(given))
    for heading, listed in (("derivative", rows), ("tail", tails)):
        if listed:
            session.table(
                [heading, "value", "standard error"],
                [
                    [
                        str(row["name"]),
                        f"{row['value']:.6g}",
                        f"{row['standard_error']:.3g}" if row["standard_error"] else "-",
                    ]
                    for row in listed
                ],
                numbers=(1, 2),
            )
    session.answer({"derivatives": rows, "tails": tails})


def _rows(found: Sequence["Derivatives"]) -> list[dict[str, Any]]:
    return [
        {"name": name, "value": float(value), "standard_error": float(error)}
        for each in found
        for name, value, error in zip(each.names, each.values, each.standard_errors, strict=True)
    ]
