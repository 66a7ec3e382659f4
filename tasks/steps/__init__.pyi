from .advance import FLOWS, Due, due, parameters_of
from .calibration import bind, calibrate
from .close_loop import prove_loop, run_loop, what_differs, what_is_left, with_bands
from .coefficients import FlightCoefficients, load_coefficients, reconstruct
from .compare import compare_loaded, compare_with_database, compare_with_version
from .conditioning import mapping_of
from .consistency import (
    applied_errors,
    check_consistency,
    load_consistent,
    noise_of,
    reconstructed_angles,
    remaining_errors,
)
from .counting import repeat_documents, repeating
from .design import design_flight
from .estimate_records import estimate_records
from .estimates_page import estimates_page
from .expand import expand_flight
from .export import FORMS, export_version
from .fly import (
    default_tolerances,
    flown_responses,
    fly_version,
    manoeuvre_windows,
    read_tolerances,
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
from .inspect_log import look_over
from .loop_flights import reconstruction_of
from .methods import estimate_by_methods
from .notes import dismiss, note_version
from .notify import deliver, tell
from .publish import publish_candidate, publish_loop
from .release import promote, roll_back
from .report import flight_page, update_page, version_page, write_update_page
from .runs import mark_ended
from .segments import segments_of
from .store import trim_cache
from .trace import find_sensor_rivals, freeze_library, trace_flight
from .update import estimate, plan_update, validate
from .validate_responses import response_page, summarise_responses

__all__ = [
    "FLOWS",
    "FORMS",
    "Due",
    "FlightCoefficients",
    "applied_errors",
    "bind",
    "calibrate",
    "check_consistency",
    "compare_loaded",
    "compare_with_database",
    "compare_with_version",
    "complete_file",
    "default_tolerances",
    "deliver",
    "describe_inputs",
    "design_flight",
    "dismiss",
    "due",
    "estimate",
    "estimate_by_methods",
    "estimate_records",
    "estimates_page",
    "expand_flight",
    "export_version",
    "files_of_inbox",
    "find_sensor_rivals",
    "flight_page",
    "flown_responses",
    "fly_manoeuvre",
    "fly_version",
    "freeze_library",
    "import_database",
    "in_quarantine",
    "load_coefficients",
    "load_consistent",
    "look_over",
    "manoeuvre_windows",
    "mapping_of",
    "mark_ended",
    "noise_of",
    "note_failure",
    "note_no_room",
    "note_tries",
    "note_version",
    "parameters_of",
    "plan_update",
    "promote",
    "prove_loop",
    "publish_candidate",
    "publish_loop",
    "read_database",
    "read_tolerances",
    "reconstruct",
    "reconstructed_angles",
    "reconstruction_of",
    "remaining_errors",
    "repeat_documents",
    "repeating",
    "respond",
    "response_page",
    "roll_back",
    "run_loop",
    "segments_of",
    "set_aside",
    "settle",
    "store_log",
    "summarise_responses",
    "tell",
    "trace_flight",
    "trim_cache",
    "update_page",
    "validate",
    "version_page",
    "what_differs",
    "what_is_left",
    "with_bands",
    "write_update_page",
]
