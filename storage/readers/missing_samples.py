"""Samples that each topic lacks where a whole file is damaged."""

from collections.abc import Iterable, Mapping

from aerodb.logs import missing_samples
from aerodb.recording import Damage, Topic


def missing_by_topic(topics: Mapping[str, Topic], damage: Iterable[Damage]) -> tuple[Damage, ...]:
    """Return the gaps of each topic where the whole file has framing or dropout damage.

    Times (n,) [s].
    """
    places = [
        (place.kind, place.start, place.end)
        for place in damage
        if not place.topic
        and place.kind in ("framing", "dropout")
        and place.start is not None
        and place.end is not None
    ]
    gaps_as_damage = []
    for name in topics if places else ():
        time = topics[name].time
        for kind, start, end in places:
            gap = missing_samples(time, start, end)
            if gap is not None:
                plural = "sample" if gap.samples == 1 else "samples"
                gaps_as_damage.append(
                    Damage(kind, f"about {gap.samples} {plural} missing", name, gap.start, gap.end)
                )
    return tuple(
        dict.fromkeys(gaps_as_damage)
    )  # one long gap may hold several dropouts of the file
