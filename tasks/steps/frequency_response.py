"""Frequency response of a stored flight, and a transfer function fitted to it."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import TimeHistory, TransferFunction, transfer_function_fit
from aerodb.flight import Flight
from aerodb.signals import bridge
from aerodb.tasks.steps.consistency import load_consistent
from aerodb.tasks.workspace_access import access_workspace

#: Share of the samples of a channel that must be usable: the others are bridged.
_COMPLETE: Final = 0.95


def respond(
    flight: str,
    *,
    workspace: str,
    run: str,
    inputs: Sequence[str],
    output: str,
    zeros: Sequence[int] = (),
    poles: Sequence[int] = (2,),
    delay: bool = True,
    since: float | None = None,
    until: float | None = None,
    lowest: float | None = None,
    highest: float | None = None,
) -> dict[str, Any]:
    """Response of a flight's (its id) channel `output` to the first of `inputs`, conditioned on the
    others, and the transfer function fitted to it.

    zeros, poles, delay : of the `TransferFunction`. since, until : stretch [s] from the flight's
    first sample. lowest, highest : band [rad/s].

    Returns a document: input, output, others, frequencies (omega [rad/s], magnitude, phase [rad],
    coherence, random_error, used), estimates (name, value, standard_error, unit, standing, reason),
    notes, assumes.
    """
    structure = TransferFunction(tuple(zeros), tuple(poles), delay)
    access = access_workspace(workspace)
    consistent = load_consistent(access, access.catalogue.flight(flight), run).flight
    record = _record(consistent, (*inputs, output), since, until)
    response, fit = transfer_function_fit(
        [record], inputs, output, structure, lowest=lowest, highest=highest
    )
    rows = zip(
        response.omega,
        np.abs(response.response),
        np.unwrap(np.angle(np.nan_to_num(response.response))),
        response.coherence,
        response.random_error,
        response.usable,
        strict=True,
    )
    return {
        "input": inputs[0],
        "output": output,
        "others": list(inputs[1:]),
        "frequencies": [
            {
                "omega": float(omega),
                "magnitude": _finite(size),
                "phase": float(phase),
                "coherence": float(coherence),
                "random_error": _finite(error),
                "used": bool(used),
            }
            for omega, size, phase, coherence, error, used in rows
        ],
        "estimates": [
            {
                "name": each.name,
                "value": _finite(each.value),
                "standard_error": _finite(each.standard_error),
                "unit": each.unit,
                "standing": each.standing,
                "reason": each.reason,
            }
            for each in fit.estimates
        ],
        "notes": list(fit.notes),
        "assumes": list(fit.assumes),
    }


def _record(
    flight: Flight, names: Sequence[str], since: float | None, until: float | None
) -> TimeHistory:
    elapsed = flight.time - flight.time[0]
    inside = (elapsed >= (since or 0.0)) & (elapsed <= (np.inf if until is None else until))
    if inside.sum() < 2:
        raise InputError("no sample in that stretch", f"flight {flight.id[:12]}", "--from, --to")
    channels = {}
    for name in names:
        values, good = flight[name][inside], flight.usable([name])[inside]
        if good.mean() < _COMPLETE:
            raise InputError(
                f"only {good.mean():.0%} of the samples of {name} are usable",
                f"flight {flight.id[:12]}",
                "choose a stretch without gaps: --from, --to",
            )
        channels[name] = bridge(np.where(good, values, np.nan))
    time = flight.time[inside]
    return TimeHistory(
        flight.id,
        time,
        {name: channels[name] for name in names[:-1]},
        {names[-1]: channels[names[-1]]},
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
