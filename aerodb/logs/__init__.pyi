from .completeness import consequence_of_zeros, consequences_of_missing
from .inspection import TopicSummary, describe, missing_by_topic
from .mapping import (
    channels_found,
    choose_mapping,
    map_recording,
    with_mapped_clock,
    zero_channels,
)
from .mapping_file import Mapping, parse_mapping
from .probe import angles_from_pressures, velocity_at_cg

__all__ = [
    "Mapping",
    "TopicSummary",
    "angles_from_pressures",
    "channels_found",
    "choose_mapping",
    "consequence_of_zeros",
    "consequences_of_missing",
    "describe",
    "map_recording",
    "missing_by_topic",
    "parse_mapping",
    "velocity_at_cg",
    "with_mapped_clock",
    "zero_channels",
]
