"""Summary of a recording: rates, gaps and damage per topic, before its fields are interpreted."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodb.recording import Damage, Recording, Topic

#: An interval longer than this many median intervals is a gap.
GAP_RATIO = 3.0


@dataclass(frozen=True)
class Gap:
    """An interval without samples.

    start, end : times of the samples before and after it, s. samples : number of samples missing,
    from the median interval.
    """

    start: float
    end: float
    samples: int

    @property
    def duration(self) -> float:
        """Length [s], a scalar."""
        return self.end - self.start


@dataclass(frozen=True)
class TopicSummary:
    """Summary of one topic.

    rate : median, Hz; nan below two samples. start, end : first and last time, s.
    """

    name: str
    samples: int
    rate: float
    start: float
    end: float
    gaps: tuple[Gap, ...]
    fields: tuple[str, ...]
    damage: tuple[Damage, ...]

    @property
    def duration(self) -> float:
        """Time [s] from the first to the last sample, a scalar."""
        return self.end - self.start

    @property
    def longest_gap(self) -> float:
        """Length [s] of the longest gap, a scalar; 0 without one."""
        return max((gap.duration for gap in self.gaps), default=0.0)


@dataclass(frozen=True)
class RecordingSummary:
    """Summary of a recording: topics in order of name, and damage that affects the whole file."""

    source: str
    format: str
    layout: str
    sha256: str
    size: int
    start: float
    end: float
    topics: tuple[TopicSummary, ...]
    damage: tuple[Damage, ...]


def median_interval(time: NDArray[np.float64]) -> float:
    """Return the median of the positive intervals of `time` (n,) [s]; nan without one.

    >>> median_interval(np.array([0.0, 0.1, 0.2, 5.0]))
    0.1
    """
    steps = np.diff(time)
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else float("nan")


def gaps(time: NDArray[np.float64], ratio: float = GAP_RATIO) -> tuple[Gap, ...]:
    """Return the intervals of `time` (n,) [s] longer than `ratio` median intervals.

    >>> [gap.samples for gap in gaps(np.array([0.0, 1.0, 2.0, 3.0, 8.0, 9.0]))]
    [4]
    """
    usual = median_interval(time)
    long = np.flatnonzero(np.diff(time) > ratio * usual)
    return tuple(_gap(time, int(k), usual) for k in long)


def missing_samples(time: NDArray[np.float64], start: float, end: float) -> Gap | None:
    """Return the gap of a topic around a damaged interval, or None.

    This is the longest interval of `time` that touches [start, end], if it is longer than 1.5
    median intervals. None if no sample is missing there, or if fewer than four samples leave the
    median interval unknown.

    Parameters
    ----------
    time : (n,), s
    start, end : s
    """
    if len(time) < 4:
        return None
    usual = median_interval(time)
    first = max(int(np.searchsorted(time, start, side="right")) - 1, 0)
    last = min(int(np.searchsorted(time, end, side="left")), len(time) - 1)
    if last <= first:
        return None
    k = first + int(np.argmax(np.diff(time[first : last + 1])))
    return _gap(time, k, usual) if time[k + 1] - time[k] > 1.5 * usual else None


def _gap(time: NDArray[np.float64], k: int, usual: float) -> Gap:
    start, end = float(time[k]), float(time[k + 1])
    return Gap(start, end, max(round((end - start) / usual) - 1, 1))


def describe(recording: Recording) -> RecordingSummary:
    """Return what ``aerodb log inspect`` shows: rate, samples, gaps, fields, damage per topic.

    Times [s], rates [Hz]. Kinds of damage: `docs/reference/conventions.md`, section "Damage".
    Fields are arrays (n,) of one topic.
    """
    topics = tuple(
        _describe_topic(recording, topic) for _, topic in sorted(recording.topics.items())
    )
    filled = [topic for topic in topics if topic.samples]
    return RecordingSummary(
        source=recording.source,
        format=recording.format,
        layout=recording.layout,
        sha256=recording.sha256,
        size=recording.size,
        start=min((topic.start for topic in filled), default=float("nan")),
        end=max((topic.end for topic in filled), default=float("nan")),
        topics=topics,
        damage=tuple(damage for damage in recording.damage if not damage.topic),
    )


def _describe_topic(recording: Recording, topic: Topic) -> TopicSummary:
    time = topic.time
    return TopicSummary(
        name=topic.name,
        samples=len(time),
        rate=1.0 / median_interval(time),
        start=float(time[0]) if len(time) else float("nan"),
        end=float(time[-1]) if len(time) else float("nan"),
        gaps=gaps(time),
        fields=tuple(topic.fields),
        damage=tuple(damage for damage in recording.damage if damage.topic == topic.name),
    )
