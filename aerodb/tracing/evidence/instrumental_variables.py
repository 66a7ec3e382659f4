"""Instruments from commanded inputs, for flights under feedback control.

A controller answers moment noise with a deflection, and so with a rate: rate and residual are then
correlated although the database lacks nothing, in every flight alike, so that the test over flights
cannot see it (docs/method/tracing.md, section 19). Commands are independent of the noise. Columns
are therefore replaced by what they would be with the rates that the commands predict: the first
stage of two-stage least squares (Theil, 1953), on the commands' responses through a few Laguerre
filters (Wahlberg, IEEE Trans. Automatic Control 36(5), 1991), which need no model of the aircraft.
The price is power: a rate that gusts caused counts for nothing.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.flight import Flight
from aerodb.support import Array
from aerodb.tracing.evidence.evidence import NUISANCE, Evidence

#: Rate -> the commands that ask for it.
COMMANDS_FOR: Final[Mapping[str, tuple[str, ...]]] = {
    "p": ("command_roll", "command_yaw"),
    "q": ("command_pitch",),
    "r": ("command_roll", "command_yaw"),
}
#: Filters per command. Each lets a part of the noise back in through the fit: one over the
#: independent samples.
_FILTERS: Final = 4


def with_commanded_rates(flight: Flight, bandwidth: float) -> Flight | None:
    """Return the flight with the rates that its commands predict, fitted to its own rates.

    bandwidth : of tracing, Hz; the filters' pole is at half of it. None where no logged command
    moved.

    Rates are (n,), in rad/s.
    """
    rates: dict[str, Array] = {}
    for rate, commands in COMMANDS_FOR.items():
        responses = [
            response for name in commands for response in _responses(flight, name, bandwidth)
        ]
        if rate in flight and responses:
            basis, good = (
                np.column_stack([np.ones(len(flight.time)), *responses]),
                flight.usable([rate]),
            )
            if good.any():
                rates[rate] = (
                    basis @ np.linalg.lstsq(basis[good], flight[rate][good], rcond=None)[0]
                )
    return flight.with_channels(rates) if rates else None


def with_instruments(evidence: Evidence, commanded: Evidence) -> Evidence:
    """Return the evidence with instruments for the columns that differ in `commanded`.

    commanded : evidence of the flight as `with_commanded_rates` returns it. Columns (n,) keep their
    units.
    """
    changed = {
        name: {
            axis: by_axis
            for axis, by_axis in commanded.columns.get(name, {}).items()
            if axis in columns
        }
        for name, columns in evidence.columns.items()
        if not name.startswith(NUISANCE)
        and any(
            not np.array_equal(column, commanded.columns.get(name, {}).get(axis, np.empty(0)))
            for axis, column in columns.items()
        )
    }
    return replace(
        evidence, instruments={name: columns for name, columns in changed.items() if columns}
    )


def _responses(flight: Flight, command: str, bandwidth: float) -> list[Array]:
    """A command (n,) through the first Laguerre filters; empty where it is not logged or did not
    move.
    """
    if command not in flight:
        return []
    values = flight[command]
    good = np.isfinite(values)
    if not good.any() or np.ptp(values[good]) == 0.0:
        return []
    from scipy.signal import lfilter  # slow to import

    index = np.arange(len(values))
    current = np.interp(index, index[good], values[good])
    pole = np.pi * bandwidth * flight.step / 2.0  # a T / 2 of the bilinear rule, a = pi * bandwidth
    denominator = (pole + 1.0, pole - 1.0)
    current = lfilter((pole, pole), denominator, current - current[0])
    responses = [current]
    while len(responses) < _FILTERS:
        current = lfilter((pole - 1.0, pole + 1.0), denominator, current)
        responses.append(current)
    return responses
