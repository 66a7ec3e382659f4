"""From a recording to a flight: canonical channels in SI on one time grid.

The way through:

1. A reader of `aerodb.storage` gives a `Recording`; `describe` summarises its topics, rates and
   gaps (`inspection`).
2. `parse_mapping` reads a mapping file, which says which logged field is which canonical channel
   (`mapping_file`); `choose_mapping` picks the one that fits, `channels_found` says what it finds
   (`found_channels`).
3. `map_recording` makes the `Flight` (`mapping`): it cleans clocks, converts units (`mapped_log`),
   resamples (`time_grid`), derives channels (`derivations`), moves air data from the probe to the
   CG (`aerodb.vehicle`), completes them (`air_data`) and flags captive flight (`captive`).
4. `usable_flight` also flags unusable samples, and refuses a log that gives no coefficient
   (`usable_flight`).
5. `Signals` gives channels, logged fields and formulas of both by name (`signals`).
6. `consequences_of_missing` says in words what the absent channels rule out (`completeness`).

Next comes `aerodb.conditioning`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .autopilot import LoggedAircraft, hover_sentence, wingless_sentence
    from .autopilots import hover_times, read_autopilot
    from .columns import TIME, find_columns, with_named_clock
    from .completeness import (
        airspeed_remedy,
        consequence_of_zeros,
        consequences_of_missing,
        not_possible,
    )
    from .found_channels import (
        channels_found,
        empty_channels,
        sensor_choices,
        with_mapped_clock,
        zero_channels,
    )
    from .inspection import TopicSummary, describe, missing_samples
    from .mapping import choose_mapping, map_recording
    from .mapping_draft import MappingDraft, draft_mapping
    from .mapping_file import Mapping, parse_mapping
    from .mapping_form import FormLine, MappingForm, answered, in_si, mapping_form
    from .rotor_draft import draft_rotorcraft
    from .rotors import FoundRotors, learnt_of
    from .signals import (
        Formula,
        Signal,
        Signals,
        in_order,
        numeric_fields,
        parse_formula,
        stated_units,
    )
    from .usable_flight import mapped_clock_suspicions, no_axis, usable_flight
    from .vehicle_draft import draft_vehicle

__getattr__, __dir__, __all__ = attach(__name__, __file__)
