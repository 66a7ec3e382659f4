"""Steps of the flows: each loads its inputs, calls the science, and keeps the result.

A flight: `store_log` reads a log and stores its flight, `check_consistency` reconstructs it,
`reconstruct` computes its total coefficients, `compare_with_version` compares these with a database
version.

A database: `import_database` stores a baseline, `tabulate_version` one as tables; `plan_update`
splits flights into identification and hold-out; `estimate` and `validate` fit and validate declared
increments, `publish_candidate` stores the new version. The closed loop uses `freeze_library`,
`trace_flight`, `run_loop`, `prove_loop` and `publish_loop` instead. `promote` and `roll_back` move
names of versions, `export_version` writes a version for a simulator.

Operation: `files_of_inbox`, `settle` and `set_aside` (the inbox), `due` (whether an update is due),
`tell` and `deliver` (notifications), `mark_ended` (crashed runs), `trim_cache` (object store).

A step takes ids and the keywords `workspace` (folder) and `run` (id of the run that stores its
result). Names of steps appear in progress output and in Prefect as ``module.function``.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .advance import FLOWS, Due, due, parameters_of
    from .calibration import bind, calibrate
    from .close_loop import (
        in_own_process,
        prove_loop,
        run_loop,
        what_differs,
        what_is_left,
        which_levels_stay,
        with_bands,
    )
    from .coefficients import reconstruct
    from .compare import compare_with_database, compare_with_version
    from .conditioning import mapping_of
    from .consistency import check_consistency, judged_beside, load_consistent
    from .counting import repeat_documents, repeating
    from .design import design_flight
    from .estimate_records import estimate_records
    from .estimates_page import estimates_page
    from .expand import expand_flight
    from .export import FORMS, export_version
    from .fly import (
        default_tolerances,
        fly_version,
        fly_window,
        manoeuvre_windows,
        read_tolerances,
        standard_document,
    )
    from .fly_manoeuvre import fly_manoeuvre
    from .frequency_response import respond
    from .importing import import_database, read_database
    from .inbox import (
        complete_file,
        files_of_inbox,
        in_quarantine,
        note_failure,
        note_no_room,
        note_tries,
        set_aside,
        settle,
    )
    from .ingest import store_log
    from .inputs import describe_inputs
    from .inspect_log import SERVOS, PlottedLog, Wanted, look_over, plot_log
    from .loop_flights import reconstruction_of
    from .loop_options import loop_options, options_of_result
    from .methods import estimate_by_methods, is_on_ground
    from .notes import dismiss, note_version
    from .notify import deliver, tell
    from .publish import publish_candidate, publish_loop
    from .release import judge_version, promote, roll_back, with_gate
    from .report import flight_page, lineage_of, update_page, version_page, write_update_page
    from .rolls import close_loop_on_rolls, plan_rolls, rolls_alone, update_from_rolls, with_rolls
    from .rotor_drafts import drafted_rotorcraft
    from .runs import mark_ended
    from .store import trim_cache
    from .tabulate import tabulate_version
    from .trace import find_sensor_rivals, freeze_library, trace_flight
    from .turbulence import turbulence
    from .update import beside_all_free, estimate, plan_update, validate
    from .validate_responses import (
        known_responses,
        response_page,
        responses_summary,
        summarise_responses,
    )
    from .wake import encounters, keep_wake

__getattr__, __dir__, __all__ = attach(__name__, __file__)
