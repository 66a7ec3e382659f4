"""Two files as one database: what another native text adds to a database, and the legs on which a
vehicle rolls, or the wake that it meets, beside its aerodynamics."""

from collections.abc import Mapping
from typing import Any

from aerodb.errors import InputError
from aerodb.exchange.native import entries, from_document, read_native, to_document
from aerodb.exchange.native_schema import DatabaseFile
from aerodb.physics import VortexPair
from aerodb.support import validated
from aerodb.tables import AeroDatabase, Number, ReferenceGeometry, parse, substituted, value_of


def joined(database: AeroDatabase, text: str, where: str) -> AeroDatabase:
    """Return a database with what another TOML text adds to it, such as the legs of its parts.

    The text is as `read_native` takes it, in SI units, with the reference left out or the same; its
    expressions may use what the database has. Raises InputError for another reference, and for a
    name that both have.
    """
    added, document = entries(text, where), to_document(database)
    reference = document["reference"]
    told = validated(DatabaseFile, {"name": database.name, "reference": reference} | added, where)
    if ReferenceGeometry(**dict(told.reference)) != database.reference:
        raise InputError(
            "another reference than that of the database",
            f"{where}: [reference]",
            "leave [reference] out: lengths and moment reference are those of the other file",
        )
    return _sum(document, added, where)


def on_legs(air: AeroDatabase, legs: AeroDatabase) -> AeroDatabase:
    """Return aerodynamics with the legs of another database (`AeroDatabase.line`), in SI
    units.

    Lengths and moment reference are those of the aerodynamics: the legs' loads follow from the
    places of their parts. Raises InputError for a name that both have.
    """
    added = {k: v for k, v in to_document(legs).items() if k not in ("name", "reference")}
    return _sum(to_document(air), added, f"{air.name} on {legs.name}")


def in_wake(air: AeroDatabase, pair: VortexPair) -> AeroDatabase:
    """Return aerodynamics whose parts feel a vortex pair [SI] at their own places
    (`aerodb.parts.wake`); V, alpha and beta hold its air at the moment reference.

    Raises InputError where the database has a part of the name ``wake``.
    """
    wake = {
        "kind": "wake",
        "circulation": pair.circulation,
        "core_radius": pair.core_radius,
        "spacing": pair.spacing,
        "point": list(pair.place),
        "heading": pair.heading,
        "slope": pair.slope,
        "core": pair.core,
    }
    return _sum(to_document(air), {"parts": {"wake": wake}}, air.name)


def wake_database(
    pair: VortexPair, errors: Mapping[str, float | None], reference: ReferenceGeometry
) -> AeroDatabase:
    """Return the database of a vortex pair [SI] alone, its place from where an encounter begins,
    with lengths [m] and moment reference of the vehicle that met it.

    errors : standard error of circulation, core_radius and spacing; None where it is not known.
    """
    sizes = {"circulation": "m^2/s", "core_radius": "m", "spacing": "m"}
    stated = ""
    for name, unit in sizes.items():
        error = errors.get(name)
        known = "" if error is None else f", prior_sigma = {error!r}"
        stated += f'{name} = {{ value = {getattr(pair, name)!r}, unit = "{unit}"{known} }}\n'
    formulas = "".join(f'{name} = "{name}"\n' for name in sizes)
    text = (
        f'name = "wake"\n[parameters]\n{stated}[parts.wake]\nkind = "wake"\n{formulas}'
        f"point = {list(pair.place)!r}\nheading = {pair.heading!r}\nslope = {pair.slope!r}\n"
        f'core = "{pair.core}"\n'
    )
    database = read_alone(text, "wake", reference)
    assert database is not None
    return database


def vortex_pair_of(database: AeroDatabase) -> VortexPair:
    """Return the vortex pair [SI] of a database of a wake alone (`AeroDatabase.line`).

    Raises InputError where its place is stated by ``right`` or ``below`` a point.
    """
    (part,) = database.parts.values()
    if part.keys() & {"right", "below"}:
        raise InputError(
            "the axis is beside its point", f"{database.name}: [parts]", "state a point of the axis"
        )
    known = {name: Number(value) for name, value in database.parameters.items()}

    def size(name: str) -> float:
        return value_of(substituted(parse(str(part[name])), known))

    return VortexPair(
        circulation=size("circulation"),
        core_radius=size("core_radius"),
        spacing=size("spacing"),
        place=tuple(part["point"]),
        heading=part["heading"],
        slope=part.get("slope", 0.0),
        core=part.get("core", "burnham_hallock"),
    )


def read_alone(text: str, where: str, reference: ReferenceGeometry) -> AeroDatabase | None:
    """Return the database of a TOML text without [reference] that has legs or a wake alone, with
    lengths [m] and moment reference of the vehicle in its place; None for any other text.

    Raises InputError as `read_native`.
    """
    added = entries(text, where)
    if "reference" in added or not added.get("parts") or added.keys() & {"terms", "derivatives"}:
        return None
    lengths = {
        "area": reference.area,
        "chord": reference.chord,
        "span": reference.span,
        "moment_reference": reference.moment_reference,
    }
    database = read_native(text, where, lengths)
    return database if database.line else None


def _sum(document: dict[str, Any], added: Mapping[str, Any], where: str) -> AeroDatabase:
    """The database of a document and of the keys of another."""
    for key in ("free_inputs", "parameters", "parts", "variables", "tables", "scattered"):
        both = sorted(document.get(key, {}).keys() & added.get(key, {}).keys())
        if both:
            raise InputError(
                f"'{both[0]}' is in both files", f"{where}: [{key}]", "rename it in one of them"
            )
        document[key] = {**document.get(key, {}), **added.get(key, {})}
    for key in ("terms", "states"):
        document[key] = [*document.get(key, []), *added.get(key, [])]
    document["derivatives"] = added.get("derivatives", {})
    return from_document(document, where)
