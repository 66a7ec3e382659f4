"""Estimates of a log that is being written, as documents that follow each other."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import Fit
from aerodb.identification import OnlineEstimation, OnlineSettings
from aerodb.increments import parse_model_file
from aerodb.logs import choose_mapping
from aerodb.storage.mappings import builtin_mappings, load_mapping
from aerodb.storage.readers import UlogStream, following
from aerodb.tasks.workspace_access import access_workspace

#: New log [s] that is waited for before estimates go on.
_BLOCK: Final = 1.0


def online_estimates(
    source: str,
    *,
    workspace: str,
    vehicle: str,
    model: str,
    version: str | None = None,
    mapping: str | None = None,
    settings: OnlineSettings | None = None,
    every: float = 5.0,
    idle: float = 5.0,
) -> Iterator[dict[str, Any]]:
    """Give the estimates of the increments declared in `model` (text) while a ULog arrives.

    source : a pipe or a file, ``-`` for standard input. version : its id; None: on no database.
    every : time [s] of the log between documents. idle : as in `following`.

    Each document: time [s], samples, behind [s], lost (bytes), method, assumes, notes, parameters
    (parameter, value, standard_error, standing, reason). The last one holds all samples.
    """
    access = access_workspace(workspace)
    described, _ = access.vehicle(vehicle)
    online = OnlineEstimation(
        parse_model_file(model),
        described,
        load_mapping(mapping) if mapping else None,
        None if version is None else access.database(version),
        settings or OnlineSettings(),
    )
    stream, told = UlogStream(source), -np.inf
    for piece in following(source, idle):
        stream.feed(piece)
        if not stream.latest - max(online.reached, stream.first) >= online.latency + _BLOCK:
            continue
        _take(online, stream, final=False)
        if online.samples and online.reached - told >= every:
            told = online.reached
            yield _document(online, stream)
    if not stream.latest - stream.first > 0.0:
        raise InputError("the log ended without data", source, "check what writes it")
    _take(online, stream, final=True)
    if not online.samples:
        raise InputError("no sample can be used", source, "check the log: aerodb log inspect")
    yield _document(online, stream)


def _take(online: OnlineEstimation, stream: UlogStream, final: bool) -> None:
    recording = stream.recording()
    if online.mapping is None:
        online.mapping = choose_mapping(recording, builtin_mappings().values())
    online.take(recording, final=final)
    stream.forget(online.needed)


def _document(online: OnlineEstimation, stream: UlogStream) -> dict[str, Any]:
    fits = online.fits()
    return {
        "time": online.reached,
        "samples": online.samples,
        "behind": stream.latest - online.reached,
        "lost": stream.lost,
        "method": online.settings.method,
        "assumes": list(dict.fromkeys(text for fit in fits.values() for text in fit.assumes)),
        "notes": [f"{axis}: {note}" for axis, fit in fits.items() for note in fit.notes],
        "parameters": list(_parameters(fits)),
    }


def _parameters(fits: Mapping[str, Fit]) -> Iterator[dict[str, Any]]:
    for axis, fit in fits.items():
        for each in fit.estimates:
            yield {
                "axis": axis,
                "parameter": each.name,
                "value": each.value if np.isfinite(each.value) else None,
                "standard_error": each.standard_error if np.isfinite(each.standard_error) else None,
                "standing": each.standing,
                "reason": each.reason,
            }
