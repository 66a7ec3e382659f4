"""A Recording: a log as it is, topics at their own rates and clocks, before any meaning is given to
them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

DamageKind = Literal["lost_tail", "framing", "dropout", "time", "values"]


@dataclass(frozen=True)
class Damage:
    """One thing that is wrong with a log.

    `kind`: ``lost_tail`` (the file ends inside a record), ``framing`` (bytes inside that belong to
    no record), ``dropout`` (the logger itself reported loss), ``time`` (a clock that runs
    backwards), ``values`` (fields that cannot be decoded). `topic` is empty when the whole file is
    concerned; `start` and `end` are seconds on the log's clock, None when unknown.
    """

    kind: DamageKind
    what: str
    topic: str = ""
    start: float | None = None
    end: float | None = None
    bytes_lost: int = 0


@dataclass(frozen=True)
class Topic:
    """One topic (or instance of one): time (n,) in s on the log's monotonic clock, fields of shape
    (n,).

    `units` holds what the log itself declares; a field without an entry has no declared unit.
    """

    name: str
    time: NDArray[np.float64]
    fields: Mapping[str, NDArray[Any]]
    units: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Recording:
    """What a reader gives: topics by name (instance ``i > 0`` as ``name.i``), metadata, damage, and
    the bytes' hash.

    `format` is one of ``ulog mcap tabular``; `layout` is what a mapping is chosen by (for example
    ``px4``, ``ros2``, ``sidpac_fdata``), empty when the reader cannot tell.
    """

    source: str
    format: str
    sha256: str
    size: int
    topics: Mapping[str, Topic]
    metadata: Mapping[str, str | int | float] = field(default_factory=dict)
    damage: tuple[Damage, ...] = ()
    start_utc: datetime | None = None
    layout: str = ""
