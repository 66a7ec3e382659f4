"""Which command answers what, and its JSON Schema."""

from collections.abc import Mapping
from typing import Any, Final

from pydantic import TypeAdapter

from aerodb.errors import UnknownNameError, nearest
from aerodb.flows.answers import flights, results, upkeep, versions

#: Command -> what it answers.
ANSWERS: Final[Mapping[str, Any]] = {
    "vehicle list": list[versions.ListedVehicle],
    "vehicle show": versions.ShownVehicle,
    "database inputs": versions.Inputs,
    "log inspect": flights.Inspection,
    "log show": flights.LogsPage,
    "flight list": list[flights.ListedFlight],
    "flight show": flights.ShownFlight,
    "flight compare": flights.FlightBeside,
    "version list": list[versions.ListedVersion],
    "version show": versions.ShownVersion,
    "version history": list[versions.Move],
    "version impact": versions.Impact,
    "version diff": versions.Diff,
    "version evaluate": versions.Evaluated,
    "version trim": versions.Trimmed,
    "version modes": versions.Modes,
    "version sweep": versions.Swept,
    "version gate": versions.Gate,
    "update": results.Update,
    "close-loop": results.Update,
    "flight ingest": list[flights.IngestedFlight | flights.RefusedLog],
    "flight frequency-response": results.FrequencyResponse,
    "flight turbulence": results.Turbulence,
    "flight wake": results.Wakes,
    "calibration list": list[flights.ListedCalibration],
    "calibration show": flights.ListedCalibration,
    "recalibrate": flights.Recalibrated,
    "estimate": results.Estimated,
    "version fly": results.Flown | results.FlownManoeuvre,
    "version validate": results.Validated,
    "version expand": versions.Expanded,
    "version lineage": versions.Lineage,
    "version promote": versions.Moved,
    "version rollback": versions.RolledBack,
    "version export": versions.Exported,
    "status": results.Status,
    "vehicle add": upkeep.AddedVehicle,
    "mapping init": upkeep.DraftedMapping,
    "database import": versions.Imported,
    "flight retract": upkeep.Retracted,
    "version tag": upkeep.Noted,
    "version comment": upkeep.Noted,
    "report flight": upkeep.WrittenReport,
    "report update": upkeep.WrittenReport,
    "report version": upkeep.WrittenReport,
    "verify": upkeep.Verified,
    "backup": upkeep.BackedUp,
    "restore": upkeep.Restored,
    "retry": list[upkeep.Retried],
    "dismiss": upkeep.Dismissed,
    "user add": upkeep.AddedUser,
    "user list": list[upkeep.ListedUser],
    "user token": upkeep.AddedUser,
    "user remove": upkeep.RemovedUser,
    "vehicle init": upkeep.DraftedVehicle,
    "derivatives": results.Converted,
    "estimate-online": results.EstimatedOnline,
    "version design": versions.Designed,
    "version back-out": versions.BackedOut,
    "version tabulate": versions.Tabulated,
    "nightly": upkeep.Night,
    "demo": results.Demonstrated,
    "store push": upkeep.Transfer,
    "store pull": upkeep.Transfer,
    "store trim": upkeep.Transfer,
}


def schema_of(command: str) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of what a command answers; UnknownNameError for a
    command that has none. Quantities are in SI units."""
    if command not in ANSWERS:
        raise UnknownNameError(f"no schema of '{command[:80]}'", "", nearest(command, ANSWERS))
    schema = TypeAdapter(ANSWERS[command]).json_schema()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"aerodb {command} --json",
        **{key: value for key, value in schema.items() if key != "title"},
    }
