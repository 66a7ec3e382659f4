"""A suspicion of a fault in a record, and those that its clocks raise before it is mapped."""

from collections.abc import Mapping
from dataclasses import dataclass

from aerodb.recording import Recording
from aerodb.remarks import Remark

#: Least number of time stamps of a topic that is a record and not a single event.
FEWEST_STAMPS = 10


@dataclass(frozen=True)
class Suspicion:
    """A likely fault: channel or topic, kind, a sentence that names the likely cause, the evidence.

    Kinds: ``no_overlap future stuck sign degrees radians gravity swapped unit size delay
    unmoved failed changed zero steps jump``.
    """

    channel: str
    kind: str
    sentence: str
    evidence: Mapping[str, float]

    @property
    def remark(self) -> Remark:
        """The suspicion as a reason of a flight's verdict, with its figures in SI units
        (`Remark`)."""
        values = {name: (float(value), "SI") for name, value in self.evidence.items()}
        return Remark(f"suspicion_{self.kind}", (self.channel,), values, self.sentence)


def clock_suspicions(recording: Recording) -> tuple[Suspicion, ...]:
    """Return the topics whose time stamps (n,) [s] do not overlap with most of the others.

    "Most" is more than half of the other topics. Topics with fewer than ten samples, or with all
    samples at one time, are events and are left out.
    """
    lasting = {
        name: t.time
        for name, t in recording.topics.items()
        if len(t.time) >= FEWEST_STAMPS and t.time[-1] > t.time[0]
    }
    spans = {name: (float(time[0]), float(time[-1])) for name, time in lasting.items()}
    listed = []
    for name, (start, end) in spans.items():
        others = [span for other, span in spans.items() if other != name]
        apart = [span for span in others if span[0] > end or span[1] < start]
        if not others or (2 * len(apart) <= len(others) and len(others) > 1) or not apart:
            continue
        low, high = min(span[0] for span in others), max(span[1] for span in others)
        cause = "it has a different clock"
        if start > 1e8 > high:
            cause = "its time stamps look like UTC, the others like time since start-up"
        elif (end - start) > 300.0 * (high - low):
            cause = "its time stamps look like milliseconds or microseconds"
        sentence = (
            f"topic {name} runs from {start:.10g} to {end:.10g} s, the others from {low:.10g} to"
            f" {high:.10g} s: {cause}"
        )
        evidence = {"start": start, "end": end, "others_start": low, "others_end": high}
        listed.append(Suspicion(name, "no_overlap", sentence, evidence))
    return tuple(listed)
