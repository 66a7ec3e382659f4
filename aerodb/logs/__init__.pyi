from .autopilot import Autopilot, wingless_sentence
from .autopilots import read_autopilot
from .columns import TIME, Columns, find_columns
from .completeness import airspeed_remedy, consequence_of_zeros, consequences_of_missing
from .found_channels import channels_found, empty_channels, with_mapped_clock, zero_channels
from .inspection import TopicSummary, describe, missing_samples
from .mapping import choose_mapping, map_recording
from .mapping_draft import MappingDraft, draft_mapping
from .mapping_file import Mapping, parse_mapping
from .usable_flight import mapped_clock_suspicions, usable_flight
from .vehicle_draft import draft_vehicle

__all__ = [
    "TIME",
    "Autopilot",
    "Columns",
    "Mapping",
    "MappingDraft",
    "TopicSummary",
    "airspeed_remedy",
    "channels_found",
    "choose_mapping",
    "consequence_of_zeros",
    "consequences_of_missing",
    "describe",
    "draft_mapping",
    "draft_vehicle",
    "empty_channels",
    "find_columns",
    "map_recording",
    "mapped_clock_suspicions",
    "missing_samples",
    "parse_mapping",
    "read_autopilot",
    "usable_flight",
    "wingless_sentence",
    "with_mapped_clock",
    "zero_channels",
]
