"""The options with which a closed loop was asked for, as the command line takes them."""

import shlex
from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final

from aerodb.storage.catalogue import Catalogue
from aerodb.tasks.result_versions import RELEASED

#: Parameter of the flow -> option of `close-loop`, given once for each entry.
_REPEATED: Final = {
    "hold_out": "--hold-out",
    "accept_lumped": "--accept-lumped",
    "accept_suspected": "--accept-suspected",
    "accept_ambiguous": "--accept-ambiguous",
    "measured": "--measured",
    "select": "--select",
}


def loop_options(
    catalogue: Catalogue, parameters: Mapping[str, Any], asked: datetime | None = None
) -> list[str]:
    """Return the options beside ``--vehicle`` that ask for the same loop again; empty for the
    defaults.

    parameters : of `aerodb.flows.close_loop.close_loop_flow`; flights and baseline are ids. A file
    of effects is named FILE, because its text alone is known. asked : when; flights that came later
    were not left out (None: now). UnknownNameError for another vehicle.
    """
    vehicle, baseline = parameters["vehicle"], parameters["baseline"]
    beside = parameters.get("beside") or ""
    rows = catalogue.versions_by_id([baseline, beside])
    labels = {id: rows[id].label if id in rows else id[:12] for id in (baseline, beside)}
    options = []
    if catalogue.names(vehicle).get(RELEASED) != baseline:
        options.append(f"--baseline {labels[baseline]}")
    options += [f"--with {labels[beside]}"] if beside else []
    chosen = parameters["flights"]
    there = {
        row.id for row in catalogue.flights(vehicle) if asked is None or row.added_utc <= asked
    }
    if not there <= {*chosen}:
        options += [f"--flights {flight[:12]}" for flight in chosen]
    options += ["--on-ground"] if parameters.get("on_ground") else []
    if parameters.get("hold_out") == []:
        options.append("--hold-out none")
    for name, option in _REPEATED.items():
        options += [f"{option} {shlex.quote(each)}" for each in parameters.get(name) or ()]
    options += ["--effects FILE"] if parameters.get("effects") else []
    library = parameters.get("library")
    return [*options, f"--library {library}"] if library else options


def options_of_result(catalogue: Catalogue, key: str) -> list[str]:
    """Return `loop_options` of the run that first made or used the result with this key; empty
    where no run did, or another flow."""
    run = catalogue.first_run_with(key)
    known = run is not None and {"vehicle", "baseline", "flights"} <= {*run.parameters}
    if run is None or not known:
        return []
    return loop_options(catalogue, run.parameters, run.started_utc)
