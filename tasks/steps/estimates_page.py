"""The page of estimates by several methods."""

from typing import Any

import numpy as np

from aerodb.errors import InputError
from aerodb.storage.files import read_results
from aerodb.support import Array
from aerodb.tasks.actors import user
from aerodb.tasks.page_head import head_of_result
from aerodb.tasks.workspace_access import access_workspace


def estimates_page(document: dict[str, Any], *, workspace: str, run: str) -> str:
    """The HTML page of a document of `estimate_by_methods`, with fitted responses and residuals.

    Reads `estimate_by_methods`' stored result. Raises InputError where it is lost.
    """
    from aerodb.report import estimates_report  # loads the drawing

    access = access_workspace(workspace)
    path, result = access.path_of(document["key"]), access.catalogue.result(document["key"])
    if path is None or result is None:
        raise InputError("its file is lost", f"result {document['key'][:12]}", "estimate again")
    table, _ = read_results(path)
    labels = [table[name].astype(str) for name in ("method", "record", "response")]
    responses: dict[str, dict[str, dict[str, tuple[Array, Array, Array]]]] = {}
    starts = np.flatnonzero(table["time"] == 0.0)
    for start, end in zip(starts, [*starts[1:], len(table["time"])], strict=True):
        method, record, response = (str(label[start]) for label in labels)
        responses.setdefault(method, {}).setdefault(record, {})[response] = (
            table["time"][start:end],
            table["fitted"][start:end],
            table["residual"][start:end],
        )
    return estimates_report(document, responses, head_of_result(access, result, user()))
