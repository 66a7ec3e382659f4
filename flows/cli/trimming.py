"""``aerodb version trim``, ``modes`` and ``sweep``: steady flights of a version and their modes."""

import inspect
import shlex
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from aerodb.errors import UnknownNameError
from aerodb.flows.cli.mode_tables import print_modes
from aerodb.flows.cli.modes_beside import Beside, Flown, Method, beside_flights, print_beside
from aerodb.flows.cli.output import HALF_INTERVAL, Session, plus_minus
from aerodb.flows.cli.references import AsOf, Vehicle
from aerodb.nomenclature import channel

if TYPE_CHECKING:
    from aerodb.storage.catalogue import VersionRow
    from aerodb.tasks.view import StatedCondition

Speed = Annotated[str, typer.Option(help="Airspeed, with unit or in m/s.")]
Altitude = Annotated[str, typer.Option(help="Altitude, with unit or in m.")]
Climb = Annotated[
    str | None,
    typer.Option(help="Flight-path angle, with unit or in rad; 0 without, found when gliding."),
]
Glide = Annotated[bool, typer.Option("--glide", help="Without thrust: the path angle is found.")]
Bank = Annotated[str | None, typer.Option(help="Bank angle: a turn, without --turn-rate.")]
Sideslip = Annotated[str | None, typer.Option(help="Sideslip: steady, without --bank.")]
TurnRate = Annotated[str | None, typer.Option(help="Rate of turn, with unit or in rad/s.")]
Load = Annotated[float | None, typer.Option(help="Load factor of a turn or pull-up, in g.")]
PullUp = Annotated[bool, typer.Option("--pull-up", help="A pull-up with --load-factor.")]
Hover = Annotated[
    bool,
    typer.Option("--hover", help="Rotors carry it: attitude, collective and three mixes found."),
]
Fuel = Annotated[str | None, typer.Option(help="Fuel mass, for a table of masses.")]
Given = Annotated[
    list[str] | None,
    typer.Option("--set", help="NAME=VALUE: surfaces held, free inputs, other masses."),
]
Thrust = Annotated[
    str | None,
    typer.Option(help="Input that holds the airspeed, such as an engine's throttle."),
]
Control = Annotated[
    list[str] | None,
    typer.Option(help="AXIS=INPUT: roll, pitch or yaw control; found without."),
]

#: Most quantities of a trim that a headline names.
_NAMED: Final = 3
#: Channels of a trim that are printed, with their SI units; load factors are in g.
_PRINTED: Final = (
    ("V", "m/s"), ("alpha", "rad"), ("beta", "rad"), ("phi", "rad"), ("theta", "rad"),
    ("climb", "rad"), ("turn_rate", "rad/s"), ("ny", "g"), ("nz", "g"), ("load_factor", "g"),
    ("mach", "1"), ("qbar", "Pa"),
)  # fmt: skip
#: Variables of a flight, of a sweep or a trim, that are no channels -> SI unit.
_VARIABLES: Final = {
    "climb": "rad", "bank": "rad", "turn_rate": "rad/s", "load_factor": "g", "force_x": "N",
}  # fmt: skip


@dataclass(frozen=True)
class _Stated:
    """The options of a steady flight of a version, as text."""

    version: str
    speed: Speed
    altitude: Altitude
    climb: Climb = None
    glide: Glide = False
    bank: Bank = None
    sideslip: Sideslip = None
    turn_rate: TurnRate = None
    load_factor: Load = None
    pull_up: PullUp = False
    hover: Hover = False
    fuel: Fuel = None
    given: Given = None
    control: Control = None
    thrust: Thrust = None
    vehicle: Vehicle = None
    as_of: AsOf = None

    def words(self, version: str, vehicle: str) -> str:
        """The version and the options that were given, as in a command; `version` and `vehicle` by
        their names."""
        names = {"given": "set"}
        said = [version, "--vehicle", vehicle]
        for field in fields(self):
            value, name = getattr(self, field.name), names.get(field.name, field.name)
            if field.name in ("version", "vehicle", "as_of") or value == field.default:
                continue
            option = f"--{name.replace('_', '-')}"
            for each in value if isinstance(value, list) else [value]:
                said += [option] if each is True else [option, str(each)]
        return shlex.join(said)

    def flight(self, glides: bool) -> "StatedCondition":
        """The flight; a vehicle that `glides` does so unless a path angle is given."""
        from aerodb.errors import InputError
        from aerodb.simulation import Condition
        from aerodb.tasks.references import value_of
        from aerodb.tasks.view import StatedCondition

        if self.glide and self.climb is not None:
            raise InputError("--glide and --climb together", remedy="in a glide the path is found")

        def read(name: str, text: str | None) -> float | None:
            return None if text is None else value_of(name, text)

        if self.glide and self.thrust is not None:
            raise InputError("--glide and --thrust together", remedy="leave one of them out")
        speed = value_of("V", self.speed)
        hover = self.hover or speed == 0.0
        if hover and (self.thrust is not None or self.glide):
            raise InputError(
                "a hover with --thrust or --glide", remedy="leave it out: the collective is found"
            )
        free = self.glide or (glides and not hover and self.climb is None and self.thrust is None)
        return StatedCondition(
            Condition(
                speed,
                value_of("altitude", self.altitude),
                None if free else read("theta", self.climb or "0"),
                read("phi", self.bank),
                read("beta", self.sideslip),
                read("r", self.turn_rate),
                self.load_factor,
                self.pull_up,
                hover,
            ),
            tuple(self.given or ()),
            tuple(self.control or ()),
            read("mass", self.fuel),
            self.thrust,
        )


def steady_flight(
    session: Session,
    row: "VersionRow",
    speed: str,
    altitude: str,
    climb: str | None,
    glide: bool,
    fuel: str | None,
    given: list[str] | None,
    thrust: str | None = None,
) -> "StatedCondition":
    """A straight steady flight of a version, as its options state it."""
    from aerodb.tasks.view import glides

    stated = _Stated(row.id, speed, altitude, climb, glide, fuel=fuel, given=given, thrust=thrust)
    return stated.flight(glides(session.catalogue(), row))


def steady_command(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command of a function of a session, a version, its steady flight, and the words
    that state it: it has the options of `_Stated` and those of the function."""
    stated = inspect.signature(_Stated).parameters
    required = [option for option in stated.values() if option.default is option.empty]
    context = inspect.Parameter("context", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context)
    own = list(inspect.signature(command).parameters.values())[4:]
    options = {o.name: o for o in (context, *required, *own, *stated.values())}

    @wraps(command)
    def run(context: typer.Context, **given: Any) -> None:
        from aerodb.tasks.references import version_of
        from aerodb.tasks.view import glides

        flight = _Stated(**{name: given.pop(name) for name in stated})
        session: Session = context.obj
        catalogue = session.catalogue()
        row = version_of(catalogue, flight.version, flight.vehicle, flight.as_of)
        stated_words = flight.words(row.label, row.vehicle)
        command(session, row, flight.flight(glides(catalogue, row)), stated_words, **given)

    run.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [option.replace(kind=option.KEYWORD_ONLY) for option in options.values()]
    )
    run.__annotations__ = {name: option.annotation for name, option in options.items()}
    return run


@steady_command
def trim(session: Session, row: "VersionRow", flight: "StatedCondition", words: str) -> None:
    """Find the steady flight of a version at a condition: angles, surfaces, thrust, with standard
    errors.

    Example: aerodb version trim released --speed 70 --altitude 1000 --bank 30deg
    """
    from aerodb.tasks.view import trim_document

    with session.saying():
        document = trim_document(session.catalogue(), row, flight)
    session.headlines(
        _steady_words(session, row, document),
        (),
        f"aerodb version modes {words}",
        _known_to(session, row, document),
    )
    session.say()
    _print_trim(session, row, document)
    session.answer(document)


@steady_command
def modes(
    session: Session,
    row: "VersionRow",
    flight: "StatedCondition",
    words: str,
    flown: Flown = None,
    method: Method = None,
    beside: Beside = None,
) -> None:
    """Show the modes about a steady flight of a version, alone or beside those of flights; --json
    also gives the linear model.

    Example: aerodb version modes released --speed 70 --altitude 1000 --flown estimate.json
    """
    from aerodb.tasks.view import modes_document

    with session.saying():
        document = modes_document(session.catalogue(), row, flight)
    session.headlines(
        f"{_steady_words(session, row, document)}; {_stability(document['modes'])}",
        (),
        f"aerodb version trim {words}",
        _known_to(session, row, document),
    )
    session.say()
    print_modes(session, document["modes"])
    if flown is not None:
        document["beside"] = beside_flights(session, row, flight, flown, method, beside)
        print_beside(session, document["beside"])
    session.say()
    _print_trim(session, row, document)
    session.answer(document)


@steady_command
def sweep(
    session: Session,
    row: "VersionRow",
    flight: "StatedCondition",
    words: str,
    variable: Annotated[
        str, typer.Option(help="V, altitude, climb, bank, ..., a mass property, or an input.")
    ],
    start: Annotated[str, typer.Option("--from", help="First value, with unit or in SI.")],
    end: Annotated[str, typer.Option("--to", help="Last value.")],
    steps: Annotated[int, typer.Option(help="Number of values.")] = 11,
    hold: Annotated[
        bool, typer.Option("--hold", help="Hold the rest as trimmed, and give coefficients.")
    ] = False,
) -> None:
    """Vary one variable while the rest of a version's flight stays in trim: trims and modes.

    Example: aerodb version sweep released --speed 70 --altitude 1000 --variable V --from 40 --to 90
    """
    from aerodb.report import beyond_words
    from aerodb.tasks.view import database_of, sweep_document, sweep_value

    reach = (sweep_value(start, variable), sweep_value(end, variable))
    document = sweep_document(session.catalogue(), row, flight, variable, reach, steps, hold)
    points = document["points"]
    factor, heading = scaled(session, variable)
    low, high = (f"{factor * end:.4g}" for end in reach)
    over = f"{row.vehicle}: {row.label} over {heading} {low} to {high}"
    if hold:
        axes = list(points[0]["coefficients"])
        spans = [_span(axis, [point["coefficients"][axis] for point in points], 3) for axis in axes]
        session.headlines(
            f"{over}, the rest as trimmed: {', '.join(spans)}",
            [("data", _data(session, row, variable))],
            f"aerodb version trim {words}",
        )
        session.say()
        rows = [
            [
                f"{factor * point['value']:.6g}",
                *(
                    plus_minus(_rounded(value), (point["standard_errors"] or {}).get(axis))
                    for axis, value in point["coefficients"].items()
                ),
            ]
            for point in points
        ]
        session.table([heading, *axes], rows, tuple(range(1 + len(axes))))
        if document["outside_of"]:
            session.say(f"outside tables: {', '.join(document['outside_of'])} (edge values held)")
        session.say(HALF_INTERVAL)
        increments = database_of(session.catalogue(), row).increments
        for sentence in beyond_words(increments, [variable], session.units):
            session.say(sentence)
        session.answer(document)
        return
    trimmed = [point for point in points if "channels" in point]
    inputs = [
        name
        for name in (trimmed[0]["inputs"] if trimmed else ())
        if any(_rounded(point["inputs"][name]) for point in trimmed)
    ]
    names = list(dict.fromkeys(mode["name"] for point in trimmed for mode in point["modes"]))
    angle = scaled(session, "alpha")[0]
    spans = [_span("alpha", [angle * p["channels"]["alpha"] for p in trimmed], 3, " deg")]
    for name in inputs:
        by, label = session.units.scale(unit_of(name))
        unit = "" if label == "-" else f" {label}"
        spans.append(_span(name, [by * p["inputs"][name] for p in trimmed], 3, unit))
    grows = [point["value"] for point in trimmed if _growing(point["modes"])]
    session.headlines(
        f"{over}: {len(trimmed)} of {len(points)} points fly steadily",
        [
            ("takes", ", ".join(spans) if trimmed else ""),
            (
                "modes",
                f"one grows at {', '.join(f'{factor * value:.4g}' for value in grows)}"
                if grows
                else "none grows" * bool(trimmed),
            ),
            ("data", _data(session, row, variable)),
        ],
        f"aerodb version modes {words}",
    )
    session.say()
    session.table(
        [heading, "alpha [deg]", *(scaled(session, name)[1] for name in inputs), *names],
        [
            [f"{factor * point['value']:.6g}", *_sweep_row(session, point, inputs, names)]
            if "channels" in point
            else [f"{factor * point['value']:.6g}", "no trim", *[""] * len(inputs + names)]
            for point in points
        ],
        numbers=tuple(range(2 + len(inputs) + len(names))),
    )
    for point in points:
        if "reason" in point:
            at = session.units.shown(point["value"], unit_of(variable), 6)
            session.say(f"{variable} {at}: {point['reason']}")
    session.answer(document)


def _steady_words(session: Session, row: "VersionRow", document: dict[str, Any]) -> str:
    """Return the steady flight in a line: the condition, and what it takes."""
    channels, inputs = document["channels"], document["inputs"]
    told = [("alpha", channels["alpha"]), ("climb", channels["climb"])]
    told += [(name, value) for name, value in inputs.items() if _rounded(value)]
    words = ", ".join(
        f"{name} {session.units.shown(_rounded(value), unit_of(name), 3)}" for name, value in told
    )
    at = session.units.shown(channels["V"], "m/s", 3)
    return f"{row.vehicle}: {row.label} flies steadily at {at} with {words}"


def _known_to(
    session: Session, row: "VersionRow", document: dict[str, Any]
) -> list[tuple[str, str]]:
    """How well the trim is known, and where the data of its version end."""
    errors = document["standard_errors"] or {}
    known = {**document["channels"], **document["inputs"]}
    told = [
        f"{name} {plus_minus(known[name], errors[name], 3, session.units.scale(unit)[0])}"
        f"{'' if label == '-' else f' {label}'}"
        for name, unit in [("alpha", "rad"), *((n, unit_of(n)) for n in document["inputs"])]
        if errors.get(name)
        for label in [session.units.scale(unit)[1]]
    ]
    return [("known to", "; ".join(told[:_NAMED])), ("data", _data(session, row, "alpha"))]


def _data(session: Session, row: "VersionRow", variable: str) -> str:
    """Where the data of a version's increments end over a variable; empty where nothing does."""
    from aerodb.report import reach_of
    from aerodb.tasks.view import database_of

    increments = database_of(session.catalogue(), row).increments
    reach = reach_of(increments, variable, session.units)
    return "" if reach is None else f"{variable} {reach.brief}".replace("\u2212", "-")


def _span(name: str, values: list[float], digits: int, unit: str = "") -> str:
    """A name with its first and last value."""
    ends = dict.fromkeys(f"{_rounded(values[k]):.{digits}g}" for k in (0, -1)) if values else ()
    return f"{name} {' to '.join(ends)}{unit}"


def _growing(found: list[dict[str, Any]]) -> list[str]:
    """Return which modes grow, and how fast."""
    return [
        f"{mode['name']} doubles in {mode['figures']['time_to_double']:.3g} s"
        for mode in found
        if mode["figures"].get("time_to_double") is not None
    ]


def _stability(found: list[dict[str, Any]]) -> str:
    """Return which modes grow, or that none does."""
    return ", ".join(_growing(found)) or f"no mode grows ({len(found)} modes)"


def _print_trim(session: Session, row: "VersionRow", document: dict[str, Any]) -> None:
    channels, errors = document["channels"], document["standard_errors"] or {}
    printed = [(name, channels[name], unit) for name, unit in _PRINTED]
    printed += [(name, value, unit_of(name)) for name, value in document["inputs"].items()]
    rows = [_row(session, *each, errors.get(each[0])) for each in printed]
    session.table([f"trim of {row.label}", "value", "standard error", "unit"], rows, (1, 2))
    for note in document["notes"]:
        session.say(note)


def _row(session: Session, name: str, value: float, unit: str, error: float | None) -> list[str]:
    factor, label = session.units.scale(unit)
    shown = "" if error is None else f"{factor * error:.2g}"
    return [name, f"{factor * _rounded(value):.5g}", shown, "" if label == "-" else label]


def _rounded(value: float) -> float:
    """Without the rounding left over from a search for zero."""
    return 0.0 if abs(value) < 1e-9 else value


def unit_of(name: str) -> str:
    """Return the SI unit of a variable; that of a free input is none."""
    if name in _VARIABLES:
        return _VARIABLES[name]
    try:
        return channel(name).unit
    except UnknownNameError:
        return "1"


def scaled(session: Session, name: str) -> tuple[float, str]:
    """Return factor of a variable to the unit that is printed, and its heading."""
    factor, label = session.units.scale(unit_of(name))
    return factor, name if label == "-" else f"{name} [{label}]"


def _sweep_row(
    session: Session, point: dict[str, Any], inputs: list[str], names: list[str]
) -> list[str]:
    cells = [f"{scaled(session, 'alpha')[0] * point['channels']['alpha']:.4g}"]
    for name in inputs:
        cells.append(f"{scaled(session, name)[0] * _rounded(point['inputs'][name]):.4g}")
    for name in names:
        found = [mode["figures"] for mode in point["modes"] if mode["name"] == name]
        cells.append("; ".join(_short(figures) for figures in found))
    return cells


def _short(figures: dict[str, float | None]) -> str:
    """``3.69/.62`` of an oscillation, else the time constant."""
    if "omega" in figures:
        return f"{figures['omega']:.3g} rad/s, zeta {figures['zeta']:.2g}"
    value = figures["time_constant"]
    return "neutral" if value is None else f"T {value:.3g} s"
