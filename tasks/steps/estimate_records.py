"""Estimates of a linear model from files without a vehicle, by several methods."""

import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from aerodb.errors import InputError
from aerodb.estimation import Fit
from aerodb.identification import (
    Method,
    chosen_methods,
    file_records,
    fitted_modes,
    parse_state_space,
    state_space_fit,
    with_recorded_trim,
)
from aerodb.recording import Recording
from aerodb.storage.limits import Limits
from aerodb.tasks.steps.methods import fits_document
from aerodb.tasks.workers import parsed_log


def estimate_records(
    files: Sequence[Path],
    model: str,
    methods: Sequence[str],
    limits: Limits,
    *,
    page: bool = False,
) -> dict[str, Any]:
    """Estimate a linear model (text of its file) from tables of time histories.

    files : CSV, MAT, Parquet or text. methods : names, or ``["all"]``. limits : of a file.

    Returns the document of `estimate_by_methods` with ``records`` (name, seconds, rate in Hz) and
    ``notes`` in place of a key, a version and flights; with the HTML ``page`` if asked for.
    """
    file, chosen = parse_state_space(model), chosen_methods(methods)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        opened = _opened(files, folder, limits, stack)
        records, notes = file_records(opened, file)
        file, steady = with_recorded_trim(file, opened)
        notes += steady

    def fitted(method: Method) -> list[Fit]:
        return [state_space_fit(method, records, file)]

    fits, compared = fits_document(
        chosen, fitted, file.state_space.estimated, lambda fit: fitted_modes(fit, file, records)
    )
    document = {
        "records": [
            {
                "record": each.name,
                "seconds": float(each.time[-1] - each.time[0]),
                "rate": 1.0 / each.step,
            }
            for each in records
        ],
        "notes": notes,
        **compared,
    }
    if page:
        from aerodb.report import estimates_report  # loads the drawing
        from aerodb.tasks.page_head import head_of_files

        responses = {
            name: {
                record: {
                    response: (
                        each[0].times[record],
                        fitted,
                        each[0].residuals[record][response],
                    )
                    for response, fitted in outputs.items()
                }
                for record, outputs in each[0].fitted.items()
            }
            for name, each in fits.items()
            if each
        }
        document["page"] = estimates_report(document, responses, head_of_files(files))
    return document


def _opened(
    files: Sequence[Path], folder: Path, limits: Limits, stack: ExitStack
) -> dict[str, Recording]:
    """Parsed files by their stems, or by their names and numbers where stems repeat."""
    opened: dict[str, Recording] = {}
    for number, path in enumerate(files):
        if not path.is_file():
            raise InputError("no such file", str(path), "check the path")
        parsed = stack.enter_context(parsed_log(path, folder / str(number), limits))
        name = path.stem if path.stem not in opened else f"{path.name} {number + 1}"
        opened[name] = parsed.recording
    return opened
