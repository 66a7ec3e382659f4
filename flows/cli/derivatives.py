"""``aerodb derivatives``: dimensional derivatives to coefficients, and back."""

from pathlib import Path
from typing import Annotated

import typer

from aerodb.flows.cli.output import Session
from aerodb.flows.cli.vehicles import read_text


def derivatives(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="File (TOML): flight condition and derivatives.")],
) -> None:
    """Convert the dimensional derivatives of a linear model (Lp, Nbeta, Zw) to those of
    coefficients, or the reverse, with standard errors.

    Example: aerodb derivatives linear-model.toml
    """
    from aerodb.identification import converted, parse_derivative_file

    session: Session = context.obj
    found = converted(parse_derivative_file(read_text(file), str(file)))
    rows = [
        {"name": name, "value": float(value), "standard_error": float(error)}
        for name, value, error in zip(found.names, found.values, found.standard_errors, strict=True)
    ]
    session.table(
        ["derivative", "value", "standard error"],
        [
            [
                str(row["name"]),
                f"{row['value']:.6g}",
                f"{row['standard_error']:.3g}" if row["standard_error"] else "-",
            ]
            for row in rows
        ],
        numbers=(1, 2),
    )
    session.answer({"derivatives": rows})
