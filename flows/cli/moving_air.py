"""``aerodb flight turbulence`` and ``flight wake``: gusts, and vortices of other aircraft."""

from collections.abc import Mapping
from typing import Annotated, Any, Final

import typer

from aerodb.flows.cli.output import Session, plus_minus
from aerodb.flows.cli.references import Since, Until, Vehicle, stretch_of
from aerodb.units import quantity

#: Sizes of a wake that are printed, with their SI units.
_SIZES: Final = {
    "circulation": "m^2/s", "core_radius": "m", "spacing": "m", "right": "m", "below": "m",
    "heading": "rad",
}  # fmt: skip


def turbulence(
    context: typer.Context,
    flight: str,
    form: Annotated[str, typer.Option(help="dryden or von_karman.")] = "dryden",
    since: Since = None,
    until: Until = None,
    highest: Annotated[float, typer.Option(help="Highest frequency [Hz].")] = 2.0,
    vehicle: Vehicle = None,
) -> None:
    """Turbulence that a flight met: intensity and scale length of the gusts u, v and w.

    Example: aerodb flight turbulence 1a2b3c --form von_karman --from 20 --to 200
    """
    from aerodb.flows.turbulence import turbulence_flow

    session: Session = context.obj
    catalogue = session.catalogue()
    row = catalogue.flight(flight, vehicle)
    named = f"{row.vehicle}: {catalogue.flight_labels([row.id])[row.id]}"
    document = session.run(
        turbulence_flow,
        {"flight": row.id, "form": form, **stretch_of(row, since, until), "highest": highest},
        direct=True,
    )
    told = [each for each in document["components"] if each["intensity"]["value"] is not None]
    strongest = max(told, key=lambda each: each["intensity"]["value"], default=None)
    fast, per_second = session.units.scale("m/s")
    long, metres = session.units.scale("m")
    session.headlines(
        f"{named} met gusts of {_value(strongest['intensity'], '.2f', fast)} {per_second} rms"
        f" in {strongest['name']} ({_range(strongest['intensity'], '.2f', fast)})"
        if strongest
        else f"{named}: this stretch does not tell the intensity of gusts",
        [
            (
                "as",
                f"{document['form']}, {document['duration']:.0f} s at"
                f" {fast * document['speed']:.1f} {per_second}, up to {document['highest']:g} Hz",
            )
        ],
        _flown_through("turbulence", _gusts_as_stated(document), row.vehicle) if strongest else "",
    )
    session.say()
    session.table(
        [
            "gust",
            f"intensity {per_second}",
            "95 %",
            f"scale {metres}",
            "95 %",
            f"noise {per_second}",
        ],
        [
            [
                each["name"],
                _value(each["intensity"], ".2f", fast),
                _range(each["intensity"], ".2f", fast),
                _value(each["scale"], ".0f", long),
                _range(each["scale"], ".0f", long),
                f"{fast * each['noise']:.2f}",
            ]
            for each in document["components"]
        ],
        (1, 3, 5),
    )
    for note in document["notes"]:
        session.say(f"- {note}")
    session.answer(document)


def wake(
    context: typer.Context,
    flights: list[str],
    since: Since = None,
    until: Until = None,
    heading: Annotated[
        str | None, typer.Option(help='Of the aircraft that made the wake, such as "30 deg".')
    ] = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="Store each as a version of a wake (released-wake).")
    ] = False,
    vehicle: Vehicle = None,
) -> None:
    """Vortex pair of another aircraft's wake that flights met, in the order given: circulation,
    core radius, spacing and place.

    Example: aerodb flight wake 1a2b3c --from 40 --to 52
    """
    from aerodb.flows.wake import wake_flow

    session: Session = context.obj
    catalogue = session.catalogue()
    flown = [catalogue.flight(each, vehicle) for each in flights]
    stretches = [stretch_of(row, since, until) for row in flown]
    document = session.run(
        wake_flow,
        {
            "flights": [row.id for row in flown],
            **stretches[0],
            "heading": None if heading is None else quantity(heading, "rad"),
            "keep": keep,
        },
        direct=True,
    )
    kept = document["versions"]
    met = sum(each["wake"] is not None for each in document["encounters"])
    session.headlines(
        f"{met} of {len(flights)} flights met a wake",
        [
            (label, "yes" if document[name] else "no")
            for label, name in (
                ("circulation falls from each to the next", "circulation_falls"),
                ("core grows from each to the next", "core_grows"),
            )
            if document[name] is not None
        ]
        + [("kept", ", ".join(f"{each['label']} ({each['name']})" for each in kept))],
        _flown_with(kept[0], flown[0].vehicle)
        if kept
        else next(
            (
                _flown_through("wake", _wake_as_stated(each["wake"]), row.vehicle)
                for row, each in zip(flown, document["encounters"], strict=True)
                if each["wake"] is not None
            ),
            "",
        ),
    )
    session.say()
    scales = {name: session.units.scale(unit) for name, unit in _SIZES.items()}
    rows = []
    for label, each in zip(flights, document["encounters"], strict=True):
        pair = each["wake"]
        shown = [_measured(pair[name], scales[name][0]) if pair else "-" for name in _SIZES]
        rows.append([label, *shown, (pair["core"] or "either") if pair else "none claimed"])
    sizes = [f"{name.removesuffix('_radius')} {unit}" for name, (_, unit) in scales.items()]
    session.table(
        ["flight", *sizes, ""],
        rows,
        range(1, 7),
    )
    for label, each in zip(flights, document["encounters"], strict=True):
        for note in each["notes"]:
            session.say(f"- {label}: {note}")
    session.answer(document)


def _flown_through(table: str, stated: Mapping[str, str], vehicle: str) -> str:
    """What to write into a manoeuvre file, and the command that flies a version through it."""
    keys = ", ".join(f'{key} = "{value}"' for key, value in stated.items())
    fly = f"aerodb version fly released --vehicle {vehicle} --manoeuvre FILE"
    return f"add {table} = {{ {keys} }} on top of a manoeuvre file; then {fly}"


def _flown_with(kept: Mapping[str, str], vehicle: str) -> str:
    """The command that flies a version through a wake that was kept."""
    return (
        f"aerodb version fly released --vehicle {vehicle} --manoeuvre FILE --with {kept['label']}"
    )


def _gusts_as_stated(document: Mapping[str, Any]) -> dict[str, str]:
    """Form, and the strongest component's intensity and scale, as a manoeuvre file states them."""
    told = [each for each in document["components"] if each["intensity"]["value"] is not None]
    strongest = max(told, key=lambda each: each["intensity"]["value"])
    stated = {"form": document["form"], "intensity": f"{strongest['intensity']['value']:.3g} m/s"}
    scale = strongest["scale"]["value"]
    return stated if scale is None else stated | {"scale": f"{scale:.3g} m"}


def _wake_as_stated(pair: Mapping[str, Any]) -> dict[str, str]:
    """A vortex pair as a manoeuvre file states it, its axis 300 m ahead of the start."""
    units = {"circulation": "m^2/s", "core_radius": "m", "spacing": "m"}
    sizes = {name: f"{pair[name]['value']:.3g} {unit}" for name, unit in units.items()}
    return ({"core": pair["core"]} if pair["core"] else {}) | sizes | {"ahead": "300 m"}


def _measured(estimate: dict[str, Any], scale: float) -> str:
    return plus_minus(estimate["value"], estimate["standard_error"], 3, scale)


def _value(limits: dict[str, Any], form: str, factor: float) -> str:
    return "-" if limits["value"] is None else f"{factor * limits['value']:{form}}"


def _range(limits: dict[str, Any], form: str, factor: float) -> str:
    low, high = (
        None if limits[name] is None else factor * limits[name] for name in ("low", "high")
    )
    if high is None:
        return "open" if low is None else f"from {low:{form}}"
    return f"{0.0 if low is None else low:{form}} to {high:{form}}"
