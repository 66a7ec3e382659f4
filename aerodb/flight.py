"""One flight: canonical channels (SI, body axes) on one time grid, unusable samples flagged."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import UnknownNameError, nearest
from aerodb.nomenclature import FLAGS, channel
from aerodb.recording import Damage
from aerodb.support import Array

Bits = NDArray[np.unsignedinteger]


@dataclass(frozen=True)
class Flight:
    """Canonical channels on a uniform time grid.

    time : (n,) s. channels : name -> (n,), SI, names as in `aerodb.nomenclature`. flags : channel
    name (or ``flight`` for all channels) -> (n,) uint8 (uint16 where a flag needs it), bits as in
    `nomenclature.FLAGS`; a channel without an entry has no flagged sample. missing : channels that
    the mapping knows and the log does not have. notes : assumptions made on the way. estimated :
    channels that an estimator on board made of other sensors (`Source` of a mapping). states :
    channels that are states of a database, under its own names.
    """

    id: str
    vehicle: str
    time: Array
    channels: Mapping[str, Array]
    flags: Mapping[str, Bits] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    damage: tuple[Damage, ...] = ()
    start_utc: datetime | None = None
    log_sha256: str = ""
    mapping: str = ""
    estimated: frozenset[str] = frozenset()
    states: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        n = self.time.shape[0]
        for name, values in self.channels.items():
            if name not in self.states:
                channel(name)
            if values.shape != (n,):
                raise ValueError(
                    f"{self.id}: channel {name} has shape {values.shape}, the time grid {(n,)}"
                )
        for name, bits in self.flags.items():
            channel(f"flags_{name}")
            if bits.shape != (n,):
                raise ValueError(
                    f"{self.id}: flags of {name} have shape {bits.shape}, the time grid {(n,)}"
                )

    def __getitem__(self, name: str) -> Array:
        if name not in self.channels:
            raise UnknownNameError(
                f"no channel '{name}'", f"flight {self.id}", nearest(name, self.channels)
            )
        return self.channels[name]

    def __contains__(self, name: object) -> bool:
        return name in self.channels

    @property
    def step(self) -> float:
        """Sampling interval [s] of the grid, a scalar."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    @property
    def duration(self) -> float:
        """Time [s] from the first to the last sample, a scalar."""
        return float(self.time[-1] - self.time[0])

    def usable(self, names: Iterable[str] = (), despite: Iterable[str] = ()) -> NDArray[np.bool_]:
        """Return a mask (n,) of samples that are finite and not flagged in any of the channels.

        names : channels to check, in addition to the flags of the flight as a whole. despite :
        flags (keys of FLAGS) to ignore, such as ``captive`` where only the motion counts.
        """
        count = ~np.uint16(sum(FLAGS[reason] for reason in despite))
        good = np.ones(len(self.time), dtype=bool)
        for name in ("flight", *names):
            if name != "flight":
                good = good & np.isfinite(self[name])
            if name in self.flags:
                good = good & ((self.flags[name] & count) == 0)
        return good

    def with_channels(self, channels: Mapping[str, Array]) -> "Flight":
        """Return the flight with these channels, (n,) in SI units, added or replaced."""
        return replace(self, channels={**self.channels, **channels})

    def with_flag(self, name: str, reason: str, where: NDArray[np.bool_]) -> "Flight":
        """Return the flight with flag `reason` (a key of FLAGS) set on channel `name` at `where`.

        where : (n,) mask.
        """
        flag = np.min_scalar_type(FLAGS[reason]).type(FLAGS[reason])
        bits = self.flags.get(name, np.zeros(len(self.time), dtype=np.uint8)) | np.where(
            where, flag, flag.dtype.type(0)
        )
        return replace(self, flags={**self.flags, name: bits})
