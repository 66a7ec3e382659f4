"""What a database needs and a vehicle's flights lack: proposals, and what each does to the
result."""

import difflib
import math
from collections.abc import Collection, Mapping, Sequence
from string import digits
from typing import Any, Final

from aerodb.coefficients import (
    UNHOLDABLE,
    Comparison,
    InputUse,
    compare,
    divisors,
    held_inputs,
    input_uses,
    lacking_inputs,
    with_held_inputs,
)
from aerodb.errors import InputError
from aerodb.exchange import property_expression, propose_bindings, written_name
from aerodb.flight import Flight
from aerodb.nomenclature import CHANNELS, WHEELS, is_surface
from aerodb.storage.catalogue import FlightRow
from aerodb.tables import AeroDatabase, Expression, Number, uneven_height_tables
from aerodb.tasks.steps.coefficients import FlightCoefficients, load_coefficients
from aerodb.tasks.steps.compare import compare_with_database
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.vehicle import Vehicle

#: Most flights along which effects are computed: the newest.
_MOST_FLIGHTS: Final = 10
#: Relative difference of reference area, span or chord beyond which a database may be of another
#: aircraft: definitions (glove, fuselage part) differ by some per cent, sister types by more.
_SAME_SIZE: Final = 0.05
#: Share of letters in common, in their order, from which the name of a deflection is another one
#: mistyped (difflib's ratio): one letter too many in "delta_rudder" leaves .96, while
#: "delta_elevon" and "delta_elevator" have .85, "delta_flap" and "delta_slat" .80.
_SPELLED_ALIKE: Final = 0.9
#: Surfaces without which an aircraft cannot be steered, as channels and other programs name them.
_CONTROLS: Final = ("elevator", "aileron", "rudder")


def describe_inputs(version: str, *, workspace: str, run: str, vehicle: str) -> dict[str, Any]:
    """Describe the inputs of a version (its id) given the vehicle's flights.

    Returns a document: inputs (names), flights (number looked at), lacking (inputs that no flight
    has and that zero is proposed for), required (those that flights must give), written (input ->
    its name in the file), expressions (input that the file alone knows -> those that may be meant;
    the last is zero, unless it divides), dividing (inputs whose zero leaves a coefficient without
    any value), proposals (the same as bindings) and uses (per input that is held or made
    from motion: name, source, written (its name in the file), channel (that is held; empty for
    another input), binding, accepted, range, effects, residuals, sentence), and warnings (kind
    ``other_reference``, with the lengths [m] or areas [m2] of both, ``control_removed``,
    ``uneven_table``, ``unused_parameter``, or ``unknown_surface`` with the surface that is meant;
    name, sentence). Ranges are in SI units,
    effects and residuals dimensionless; InputError where the database cannot be evaluated.
    """
    access = access_workspace(workspace)
    flights = flights_of(access, vehicle, run)
    return inputs_document(
        access, vehicle, access.database(version), flights, bindings_of(access, version)
    )


def flights_of(access: WorkspaceAccess, vehicle: str, run: str) -> list[FlightCoefficients]:
    """Return the newest flights of a vehicle, at most `_MOST_FLIGHTS`, that count and whose
    coefficients (n,) are known; one whose calculation raises InputError is left out."""
    rows = [row for row in access.catalogue.flights(vehicle) if _stands(row)]
    loaded = []
    for row in rows[-_MOST_FLIGHTS:]:
        try:
            loaded.append(load_coefficients(access, row, run))
        except InputError:
            continue  # the flight's own documents say why
    return loaded


def _stands(row: FlightRow) -> bool:
    return row.retracted_utc is None and row.verdict != "rejected"


def bindings_of(access: WorkspaceAccess, version: str) -> Mapping[str, str]:
    """Return the bindings with which the database below a version (its id) was imported: input ->
    expression (see `inputs_document`).

    Reads the catalogue. Raises KeyError for an unknown id.
    """
    catalogue = access.catalogue
    row = catalogue.versions_by_id([version])[version]
    while row.parent is not None:
        row = catalogue.versions_by_id([row.parent])[row.parent]
    found: Mapping[str, str] = catalogue.settings_of([row.id])[row.id].get("bindings", {})
    return found


def inputs_document(
    access: WorkspaceAccess,
    vehicle: str,
    database: AeroDatabase,
    flights: Sequence[FlightCoefficients],
    bindings: Mapping[str, str],
) -> dict[str, Any]:
    """Return the document of `describe_inputs` for a database that need not be stored, in SI
    units."""
    lacking = lacking_inputs(database, [loaded.flight.channels for loaded in flights])
    required = [name for name in lacking if name in UNHOLDABLE]
    lacking = tuple(name for name in lacking if name not in UNHOLDABLE)
    held = with_held_inputs(database, lacking)
    described, _ = access.vehicle(vehicle)
    pairs = []
    for loaded in flights:
        try:
            comparison = compare(loaded.flight, loaded.coefficients, held, described.reference)
        except InputError:
            continue  # it lacks what other flights have
        pairs.append((loaded.flight, comparison))
    new = {name if name in held.variables else f"{name}_held" for name in lacking}
    free, channels = database.free_inputs, _known(described, flights)
    written = {name: written_name(name, free.get(name, "")) for name in database.inputs}
    dividing = divisors(database, [name for name in lacking if name in free])
    expressions = {
        name: [
            text
            for text in propose_bindings(name, free[name], channels)
            if text != "0" or name not in dividing
        ]
        for name in lacking
        if name in free
    }
    uses = input_uses(held, described, pairs, new, _bound(held, bindings, pairs))
    sizes = [
        _size(name, getattr(database.reference, name), getattr(described.reference, name))
        for name in ("area", "span", "chord")
    ]
    return {
        # A state with a rate goes along a flight by itself.
        "inputs": [name for name in database.inputs if name not in database.rates],
        "flights": len(pairs),
        "lacking": list(lacking),
        "required": required,
        "uses": [_use(use) for use in uses],
        "written": written,
        "expressions": expressions,
        "dividing": list(dividing),
        "proposals": {
            name: [f"{written[name]}={expression}" for expression in proposed]
            for name, proposed in expressions.items()
        },
        "warnings": [
            each
            for each in (
                *sizes,
                *(_removed(use, described.surfaces) for use in uses),
                *(_uneven(*each) for each in uneven_height_tables(database).items()),
                *(_unused(name) for name in database.unused_parameters),
                *(_mistyped(name, database, described.surfaces) for name in database.inputs),
            )
            if each
        ],
    }


def _size(name: str, of_database: float, of_vehicle: float) -> dict[str, Any] | None:
    """Return the warning of a reference length or area [SI] that the vehicle file has otherwise."""
    if abs(of_database - of_vehicle) <= _SAME_SIZE * of_vehicle:
        return None
    unit = "m^2" if name == "area" else "m"
    return {
        "kind": "other_reference",
        "name": name,
        "database": of_database,
        "vehicle": of_vehicle,
        "sentence": (
            f"the database's reference {name} is {of_database:.4g} {unit}, the vehicle file's"
            f" {of_vehicle:.4g} {unit}: is it the same aircraft?"
        ),
    }


def _removed(use: InputUse, surfaces: Collection[str]) -> dict[str, Any] | None:
    """Return the warning of a control that is, or is proposed to be, held at zero."""
    written = written_name(use.name, use.description)
    name = use.channel or written
    control = next((each for each in _CONTROLS if each in name), None)
    if use.binding != "zero" or control is None or use.effects == ():
        return None
    own = [f"delta_{each}" for each in surfaces if control in each]
    bind = own and not use.channel
    remedy = f"bind it to {' or '.join(own)}" if bind else "map its deflection from the log"
    return {
        "kind": "control_removed",
        "name": use.name,
        "control": control,
        "sentence": f"zero for {name} removes the {control} from the database: {remedy}",
    }


def _uneven(table: str, what: str) -> dict[str, Any]:
    """Return the warning of a table over height (`uneven_height_tables`)."""
    sentence = f"{what}: ground effect fades upwards without a turn, see the source of the numbers"
    return {"kind": "uneven_table", "name": table, "sentence": sentence}


def _unused(name: str) -> dict[str, Any]:
    """The warning of a parameter that no expression uses."""
    sentence = f"[parameters] {name}: no expression uses it, and no flight can tell anything of it"
    return {"kind": "unused_parameter", "name": name, "sentence": sentence}


def _mistyped(
    name: str, database: AeroDatabase, surfaces: Collection[str]
) -> dict[str, Any] | None:
    """Return the warning of a deflection that the vehicle has no surface of, where it has one that
    is spelled alike and that the database does not read; another number is another surface."""
    own = [f"delta_{each}" for each in surfaces]
    if not is_surface(name) or name in database.free_inputs or name in own:
        return None
    letters = name.rstrip(digits)
    free = [n for n in own if n not in database.inputs and n.rstrip(digits) != letters]
    alike = difflib.get_close_matches(name, free, n=1, cutoff=_SPELLED_ALIKE)
    if not alike:
        return None
    sentence = f"the vehicle has no surface of {name}: is {alike[0]} meant?"
    return {"kind": "unknown_surface", "name": name, "meant": alike[0], "sentence": sentence}


def _known(vehicle: Vehicle, flights: Sequence[FlightCoefficients]) -> list[str]:
    """Channels that a vehicle has: those of its flights, its surfaces, and the common ones."""
    logged = {name for loaded in flights for name in loaded.flight.channels}
    common = set(CHANNELS).difference(WHEELS)
    return sorted(logged | {f"delta_{name}" for name in vehicle.surfaces} | common)


def input_remarks(
    access: WorkspaceAccess,
    vehicle: str,
    version: str,
    database: AeroDatabase,
    flights: Sequence[str],
    run: str,
) -> list[str]:
    """Return a sentence per input that `database`, made from a version (its id), holds at zero,
    where a coefficient depends on it.

    flights : their ids; the newest are looked at.
    """
    bindings = bindings_of(access, version)
    if not bindings and not held_inputs(database):
        return []
    loaded = [compare_with_database(access, f, database, run) for f in flights[-_MOST_FLIGHTS:]]
    compared = [(each.flight, each.comparison) for each in loaded]
    bound = _bound(database, bindings, compared)
    uses = input_uses(database, access.vehicle(vehicle)[0], compared, (), bound)
    return [f"{use}." for use in uses if use.effects and use.binding == "zero"]


def _bound(
    database: AeroDatabase,
    bindings: Mapping[str, str],
    compared: Sequence[tuple[Flight, Comparison]],
) -> dict[str, Expression | None]:
    """Variables that somebody bound to a number at import -> what they would be from the flights'
    channels, None where the flights cannot say."""
    channels = [set(flight.channels) for flight, _ in compared]
    known = set.intersection(*channels) if channels else set()
    known |= {f"{angle}dot" for angle in ("alpha", "beta") if angle in known}
    bound: dict[str, Expression | None] = {}
    for name, variable in database.variables.items():
        names = {name, written_name(name, variable.description), *variable.declared.values()}
        key = next((key for key in bindings if key in names), None)
        if key is not None and isinstance(variable.expression, Number):
            otherwise = property_expression(key)
            can = otherwise is not None and otherwise.names <= known
            bound[name] = otherwise if can else None
    return bound


def _use(use: InputUse) -> dict[str, Any]:
    return {
        "name": use.name,
        "source": use.source,
        "written": written_name(use.name, use.description),
        "channel": use.channel,
        "binding": use.binding,
        "accepted": use.accepted,
        "range": {"low": use.range.low, "high": use.range.high, "origin": use.range.origin},
        "effects": [
            {
                "axis": effect.axis,
                "change": effect.change,
                "of_residual": effect.share if math.isfinite(effect.share) else None,
            }
            for effect in use.effects or ()
        ],
        "residuals": [each._asdict() for each in use.residuals],
        "sentence": str(use),
    }
