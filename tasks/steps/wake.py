"""Wake of another aircraft that stored flights met."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.consistency import air_data_of_sensors, air_velocity, probe_path
from aerodb.errors import InputError
from aerodb.exchange import database_content_sha256, wake_database
from aerodb.flight import Flight
from aerodb.identification import identify_wake
from aerodb.physics import CORES, VortexPair, quaternion_from_euler, to_earth
from aerodb.storage.catalogue import FlightRole
from aerodb.support import Array
from aerodb.tasks.result_versions import CANDIDATE, NAMES, RELEASED
from aerodb.tasks.steps.consistency import load_consistent, unmeasured_angles
from aerodb.tasks.steps.importing import known_vehicle
from aerodb.tasks.steps.ingest import flight_as_measured
from aerodb.tasks.steps.publish import add_version, move
from aerodb.tasks.workspace_access import access_workspace
from aerodb.vehicle import Vehicle

#: Longest encounter [s]: the search is over every sample.
LONGEST: Final = 60.0
#: Flags of air data that count here: crossing a core takes a few samples, like a wild point.
_CORES: Final = ("wild_point",)
#: Least angle between path and axis at which one vane tells a wake's sizes [rad]: below it a pair
#: is crossed in as much time as a long gust, 100 m for a spacing of 17 m.
_CROSSED: Final = float(np.deg2rad(10.0))
#: Sizes of a wake that a version has as parameters.
_SIZES: Final = ("circulation", "core_radius", "spacing")
#: Velocity of the air that a flow angle shows, and its body axis.
_ACROSS: Final = {"alpha": "up and down", "beta": "to the sides"}
_AXIS: Final = {"alpha": 2, "beta": 1}


def encounters(
    flights: Sequence[str],
    *,
    workspace: str,
    run: str,
    since: float | None = None,
    until: float | None = None,
    heading: float | None = None,
) -> dict[str, Any]:
    """The vortex pair that each of some flights (ids) met, in the order given.

    since, until : stretch [s] from the first sample. heading : of the aircraft that made the wake
    [rad].

    Returns a document: encounters (flight, since, until [s], air: least and greatest velocity
    north, east, down [m/s], wake: whether one is claimed, gain, needed, circulation, core_radius,
    spacing, right, below, heading, slope with value and standard_error, nearest [m], core, place:
    north, east, altitude [m] from where the stretch begins, track there [rad], notes),
    circulation_falls and core_grows (null for fewer than two wakes).
    """
    access = access_workspace(workspace)
    met = []
    for each in flights:
        row = access.catalogue.flight(each)
        vehicle, _ = access.vehicle(row.vehicle)
        consistent = load_consistent(access, row, run)
        errors = {
            entry["parameter"]: entry["value"]
            for entry in consistent.document.get("estimates", ())
            if entry["applied"]
        }
        # The smoother takes the core of a vortex for noise.
        sensed = air_data_of_sensors(flight_as_measured(access, row, run), vehicle, errors)
        consistent = replace(consistent, flight=consistent.flight.with_channels(sensed))
        absent = unmeasured_angles(consistent.document)
        met.append(
            _encounter(
                consistent.flight, vehicle, absent, f"flight {row.label}", since, until, heading
            )
            | {"flight": row.id}
        )
    pairs = [each["wake"] for each in met if each["wake"]]

    def rises(name: str, sign: float) -> bool | None:
        values = [sign * pair[name]["value"] for pair in pairs]
        return bool(np.all(np.diff(values) > 0.0)) if len(values) > 1 else None

    return {
        "encounters": met,
        "circulation_falls": rises("circulation", -1.0),
        "core_grows": rises("core_radius", 1.0),
    }


def keep_wake(flight: str, *, workspace: str, run: str, wake: Mapping[str, Any]) -> dict[str, Any]:
    """Store the vortex pair that a flight (its id) met as a version of the line of wakes, which
    becomes ``released-wake`` where none is.

    wake : as of `encounters` [SI]; of the version, the place counts from where the encounter
    begins, and north is the track there. Returns a document: version, label, name (that which it
    now has).
    """
    access = access_workspace(workspace)
    row = access.catalogue.flight(flight)
    pair = _along_track(wake)
    errors = {name: wake[name]["standard_error"] for name in _SIZES}
    lengths = known_vehicle(access.vehicle(row.vehicle)[0]).reference
    assert lengths is not None  # of a vehicle file they are always known
    database = wake_database(pair, errors, lengths)
    consistent = load_consistent(access, row, run)
    version = add_version(
        access,
        database,
        row.vehicle,
        None,
        [consistent.key],
        {"wake": database_content_sha256(database)},
        {"wake": dict(wake)},
        [FlightRole(flight, "identified")],
        run,
    )
    name = NAMES["wake"][RELEASED]
    if access.named(row.vehicle, name) in (None, version.id):
        move(access, row.vehicle, name, version.id, f"first wake (flight {row.label})")
    else:
        name = NAMES["wake"][CANDIDATE]
        move(access, row.vehicle, name, version.id, f"wake of flight {row.label}")
    return {"version": version.id, "label": version.label, "name": name}


def _along_track(wake: Mapping[str, Any]) -> VortexPair:
    """The pair [SI] in axes that are turned to the track at the begin of its encounter."""
    value = {name: float(wake[name]["value"]) for name in (*_SIZES, "heading", "slope")}
    north, east, up = wake["place"]
    core = wake["core"] or CORES[-1]
    return VortexPair(**value, place=(north, east, up), core=core).along(wake["track"])


def _encounter(
    flight: Flight,
    vehicle: Vehicle,
    absent: frozenset[str],
    where: str,
    since: float | None,
    until: float | None,
    heading: float | None,
) -> dict[str, Any]:
    lacking = sorted(absent | {name for name in ("alpha", "beta") if name not in flight})
    elapsed = flight.time - flight.time[0]
    inside = (elapsed >= (since or 0.0)) & (elapsed <= (np.inf if until is None else until))
    if not inside.any() or np.ptp(elapsed[inside]) > LONGEST:
        raise InputError(
            f"the stretch lasts {np.ptp(elapsed[inside]) if inside.any() else 0.0:.0f} s",
            where,
            f"name the encounter, up to {LONGEST:g} s: --from, --to",
        )
    air = air_velocity(flight, _CORES)[:, inside]
    doubted = int((np.isfinite(air) & ~np.isfinite(air_velocity(flight)[:, inside])).any(0).sum())
    good = np.asarray(np.isfinite(air).all(axis=0))
    if not good.any():
        raise InputError("no usable sample", where, "choose another stretch: --from, --to")
    first, last = np.flatnonzero(good)[[0, -1]]
    whole = slice(int(first), int(last) + 1)
    if not good[whole].all():
        raise InputError("the stretch has gaps", where, "choose one without: --from, --to")
    air = air[:, whole]
    document: dict[str, Any] = {
        "since": float(elapsed[inside][whole][0]),
        "until": float(elapsed[inside][whole][-1]),
        "air": {
            name: [float(values.min()), float(values.max())]
            for name, values in zip(("north", "east", "down"), air, strict=True)
        },
        "wake": None,
        "notes": [],
    }
    if doubted:
        document["notes"].append(
            f"samples like wild points that are used: {doubted}; a vortex core looks like them"
        )
    if len(lacking) == len(_ACROSS):
        document["notes"].append(
            f"{' and '.join(lacking)} not measured: the velocity of the air across the path is not"
            " known, and no wake is sought"
        )
        return document
    axes = None
    if lacking:
        (vane,) = _ACROSS.keys() - set(lacking)
        document["notes"].append(
            f"{lacking[0]} not measured: the wake is sought in the velocity of the air"
            f" {_ACROSS[vane]} alone"
        )
        axes = _body_axes(flight, inside)[[_AXIS[vane]]][:, :, whole]
    path = probe_path(flight, vehicle, inside)[:, whole]
    found = identify_wake(air, path, axes=axes, heading=heading)
    pair = found.pair
    if not found.found:
        document["notes"].append(
            f"no wake is claimed: likelihood grows by {found.gain:.1f}, {found.needed:.1f} are"
            " needed; the air is that of turbulence, or the path stayed outside of the wake"
        )
        return document
    if lacking and (heading is None or _angle(path, heading) < _CROSSED):
        document["notes"].append(
            f"the air is that of a wake: likelihood grows by {found.gain:.1f}, {found.needed:.1f}"
            " are needed; "
            + (
                "one vane tells its sizes where --heading states its axis"
                if heading is None
                else "one vane does not tell its sizes from a path along its axis"
            )
        )
        return document
    if not found.core:
        document["notes"].append(
            f"the path comes within {found.nearest / pair.core_radius:.1f} core radii: the models"
            " lamb_oseen and burnham_hallock are not told apart"
        )
    if "beta" in lacking:
        document["notes"].append("alpha alone does not tell whether the wake is above or below")
        found.errors["below"] = np.nan
    right, below = pair.across(path[:, :1])
    values = {
        "circulation": pair.circulation,
        "core_radius": pair.core_radius,
        "spacing": pair.spacing,
        "right": -float(right[0]),
        "below": -float(below[0]),
        "heading": pair.heading,
        "slope": pair.slope,
    }
    document["wake"] = {
        "gain": found.gain,
        "needed": found.needed,
        "nearest": found.nearest,
        "core": found.core,
        "place": list(pair.place),
        "track": _track(path),
        **{
            name: {"value": value, "standard_error": _finite(found.errors[name])}
            for name, value in values.items()
        },
    }
    return document


def _body_axes(flight: Flight, inside: NDArray[np.bool_]) -> Array:
    """Body axes (3, 3, m) forward, right, down, each in north, east, down, over some samples."""
    attitude = quaternion_from_euler(
        *(np.nan_to_num(flight[name][inside]) for name in ("phi", "theta", "psi"))
    )
    ones = np.ones(attitude.shape[1])
    return np.stack([to_earth(attitude, np.outer(axis, ones)) for axis in np.eye(3)])


def _track(path: Array) -> float:
    """Direction [rad from north] in which a path (3, m) begins: over its first tenth."""
    north, east = path[:2, max(1, path.shape[1] // 10)] - path[:2, 0]
    return float(np.arctan2(east, north))


def _angle(path: Array, heading: float) -> float:
    """Angle [rad] from 0 to 90 deg between a path (3, m) and an axis."""
    north, east = path[:2, -1] - path[:2, 0]
    turned = np.arctan2(east, north) - heading
    return float(abs(np.arcsin(np.sin(turned))))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
