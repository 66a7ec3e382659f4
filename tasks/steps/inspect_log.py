"""Conditioning findings of a log that is only inspected: nothing is stored, no vehicle is
needed."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from aerodb.errors import InputError
from aerodb.logs import Formula, Mapping, Signal
from aerodb.support import Array
from aerodb.tasks.workers import FINDINGS, confined

#: Topics of a PX4 log with what its servos are told.
SERVOS: Final = ("actuator_servos", "actuator_outputs")


def look_over(topics: Path, log: str, mapping: Mapping, workspace: str) -> dict[str, Any]:
    """Return likely faults, segments and delays of a parsed log, and notes on its channels.

    topics : folder of its topics. log : its name, for errors. If it cannot become a flight within
    the limits of the workspace, ``refused`` says why; ``unusable``, why it gives no coefficient.
    ``rate`` [Hz] and ``duration`` [s] are of the flight, ``computed`` its channels that no field
    holds, ``outlook`` that of its flow angles (`aerodb.consistency.unmeasured_angles_outlook`).
    """
    try:
        return confined(
            _looked_over,
            topics,
            log,
            mapping,
            workspace=workspace,
            flight=log,
            what="the conversion into a flight",
            where=log,
            needs=FINDINGS,
        )
    except InputError as error:
        return refused(error, [])


def _looked_over(topics: Path, log: str, mapping: Mapping) -> dict[str, Any]:
    from aerodb.tasks.steps.log_findings import looked_over  # in the process that needs it

    return looked_over(topics, log, mapping)


def refused(error: InputError, suspicions: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the document of `look_over` for a log that cannot become a flight."""
    return {
        "unusable": error.what,
        "rate": None,
        "duration": None,
        "computed": [],
        "outlook": {},
        "suspicions": suspicions,
        "segments": [],
        "delays": [],
        "notes": [],
        "refused": str(error),
    }


@dataclass(frozen=True)
class Wanted:
    """What to plot of a log: panels of names (a channel, ``TOPIC:FIELD`` or a formula's), and
    formulas; `first` : channels of the panels where none is named, at most `most` panels, of at
    most `points` samples a line."""

    panels: tuple[tuple[str, ...], ...]
    formulas: tuple[Formula, ...]
    first: tuple[str, ...]
    most: int
    points: int


@dataclass(frozen=True, eq=False)
class PlottedLog:
    """Lines of a log for plots: `panels` as wanted, decimated with their extremes; `track` : time
    [s], north and east [m] (3, n), None where no position is logged; `start` [s] on the log's
    clock, from which times count. `found` : document of `look_over`, None without a mapping."""

    found: dict[str, Any] | None
    panels: tuple[tuple[Signal, ...], ...]
    track: Array | None
    start: float


def plot_log(
    topics: Path, log: str, mapping: Mapping | None, workspace: str, wanted: Wanted
) -> PlottedLog:
    """Return what a parsed log shows without a vehicle, and the document of `look_over`: confined,
    in SI units.

    Raises UnknownNameError for a name that the log lacks, InputError where the log breaks a limit.
    """
    return confined(
        _plotted,
        topics,
        log,
        mapping,
        wanted,
        workspace=workspace,
        flight=log,
        what="the conversion into a flight",
        where=log,
        needs=FINDINGS,
    )


def _plotted(topics: Path, log: str, mapping: Mapping | None, wanted: Wanted) -> PlottedLog:
    from aerodb.tasks.steps.log_findings import plotted  # in the process that needs it

    return plotted(topics, log, mapping, wanted)
