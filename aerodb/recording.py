"""A log as recorded: topics at their own rates and on their own clocks, not yet interpreted."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:  # the catalogue's queries need no numerical code
    import numpy as np
    from numpy.typing import NDArray


DamageKind = Literal["lost_tail", "framing", "dropout", "time", "values"]


@dataclass(frozen=True)
class Damage:
    """One defect of a log.

    `kind`: ``lost_tail`` (the file ends inside a record), ``framing`` (bytes that belong to no
    record), ``dropout`` (loss reported by the logger itself), ``time`` (a clock that runs
    backwards), ``values`` (fields that cannot be decoded). `topic` is empty when the whole file is
    affected; `start` and `end` are in seconds on the log's clock, None when unknown.
    """

    kind: DamageKind
    what: str
    topic: str = ""
    start: float | None = None
    end: float | None = None
    bytes_lost: int = 0


@dataclass(frozen=True)
class LoggedMessage:
    """A sentence that the logger itself wrote, at `time` [s] on the log's clock; `level` in lower
    case, such as ``info`` or ``warning``."""

    time: float
    level: str
    text: str


@dataclass(frozen=True)
class Topic:
    """One topic, or one instance of it: time (n,) [s] on the log's monotonic clock, fields (n,).

    `units` holds the units that the log itself declares; a field without an entry declares none.
    """

    name: str
    time: "NDArray[np.float64]"
    fields: "Mapping[str, NDArray[Any]]"
    units: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Recording:
    """Output of a log reader: topics by name, metadata, damage, and the sha256 of the file.

    An instance ``i > 0`` of a topic is named ``name.i``. `format` is one of ``ulog mcap dataflash
    mavlink rosbag tabular``.
    `layout` names the mapping that fits (for example ``px4``, ``ros2``, ``sidpac_fdata``); empty
    when the reader cannot tell. `messages` in the order of the file.
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
    messages: tuple[LoggedMessage, ...] = ()
