from .completeness import prevents
from .inspection import TopicSummary, describe, missing_by_topic
from .mapping import channels_found, choose_mapping, map_recording, on_mapped_clock
from .mapping_file import Mapping, parse_mapping
from .probe import angles_from_pressures, velocity_at_cg

__all__ = [
    "Mapping",
    "TopicSummary",
    "angles_from_pressures",
    "channels_found",
    "choose_mapping",
    "describe",
    "map_recording",
    "missing_by_topic",
    "on_mapped_clock",
    "parse_mapping",
    "prevents",
    "velocity_at_cg",
]
