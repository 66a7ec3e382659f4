"""Which tests run first, and which in the same process, when several processes share them
(pytest-xdist, by files)."""

from typing import Any

import pytest
from xdist.scheduler import LoadFileScheduling

#: Files that share what takes long to make and is made once in a process: the flights of
#: `tracing_flights`.
TOGETHER = (
    "test_tracing_campaign.py",
    "test_tracing_commands.py",
    "test_tracing_manoeuvres.py",
)
#: Files that take longest, as `pytest --durations` tells, the longest first: one that was begun
#: last would keep others waiting.
LONGEST = (
    "test_demo.py",
    "test_demo_blind.py",
    "test_closed_loop_measured.py",
    *TOGETHER,
    "test_orphans.py",
    "test_serve.py",
    "test_closed_loop_jsbsim.py",
    "test_ground_roll_commands.py",
    "test_roll_search.py",
    "test_guides.py",
    "test_console_browser.py",
    "test_inbox.py",
    "test_flows.py",
    "test_postgresql_workspace.py",
    "test_odd_console.py",
    "test_operator_browser.py",
    "test_closed_loop_rates.py",
    "test_report.py",
    "test_faults.py",
    "test_fuzz_readers.py",
    "test_disks.py",
    "test_kills.py",
    "test_distributed.py",
    "test_twin_otter_predictions.py",
    "test_stall_walk.py",
    "test_consistency_installation.py",
    "test_without_vanes.py",
    "test_vertical_air.py",
    "test_closed_loop_bad_input.py",
    "test_beyond_envelope.py",
    "test_notebooks.py",
    "test_console_hostile.py",
    "test_clones.py",
    "test_promotion.py",
    "test_catalogue_safety.py",
    "test_flights_that_fail.py",
    "test_flight_page_browser.py",
    "test_simulation_browser.py",
    "test_object_store.py",
    "test_wrong_shapes.py",
    "test_cli.py",
    "test_wheel.py",
    "test_suspicions_of_flights.py",
    "test_version_notes.py",
    "test_corrupted.py",
    "test_export_command.py",
    "test_conditioning_simulated.py",
    "test_flown_measured.py",
    "test_consistency_flow.py",
    "test_phoenix.py",
    "test_postgresql_commands.py",
    "test_object_store_faults.py",
    "test_ingest_conditioning.py",
    "test_smoother.py",
    "test_confined.py",
    "test_envelope_expansion.py",
    "test_filter_error.py",
    "test_output_error.py",
    "test_experiment.py",
)


def long_first(items: list[pytest.Item]) -> None:
    """Brings the tests of long files to the front; all others keep their order."""
    place = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.name, len(LONGEST)))


class ByFiles(LoadFileScheduling):
    """A file, or those that stand together, to a process at a time, in the order in which they were
    collected."""

    def __init__(self, config: pytest.Config, log: Any = None) -> None:
        config.option.loadscopereorder = False
        super().__init__(config, log)

    def _split_scope(self, nodeid: str) -> str:
        file = super()._split_scope(nodeid)
        return "together" if file.rpartition("/")[2] in TOGETHER else file
