"""What checks notice of corrupted flights and wrong vehicle files, and of right ones.

``python -m tests.campaigns.corrupted`` prints a table: kind of corruption -> flights on which it was
noticed, and silent. A flight counts for a kind only if the corruption changes its coefficients, or
the control derivative that this flight determines, by more than 2 %.
"""

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.conditioning import flag_unusable
from aerodb.conditioning.plausibility import suspicions
from aerodb.crosschecks import against_vehicle
from aerodb.crosschecks.equation_error import equation_errors
from aerodb.crosschecks.surfaces import by_role
from aerodb.errors import InputError
from aerodb.examples.phoenix import mission, read_example
from aerodb.flight import Flight
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.tabular import read_tabular
from aerodb.vehicle import Vehicle, add_combinations, parse_vehicle
from tests.support import effect_flights
from tests.support.measured_flights import ATTAS, CITATION, HFB320, STALLS, TWIN_OTTER
from tests.support.paths import ROOT, VEHICLES

_SURFACES = "".join(
    f'[surfaces.{name}]\nlimits = ["-30 deg", "30 deg"]\n'
    for name in ("aileron_left", "aileron_right", "rudder")
)
#: DLR HFB-320 and Cessna Citation as published (SOURCE.md beside the data); inertias are estimates.
_PUBLISHED = {
    HFB320: (30.1, 2.43, 14.49, 7472.0, 30000.0, 91400.0, 110000.0, 2000.0),
    CITATION: (30.0, 2.0569, 15.911, 6000.0, 28000.0, 34000.0, 60000.0, 100.0),
}


@dataclass(frozen=True)
class Pair:
    """A right flight with its right vehicle file."""

    name: str
    flight: Flight
    vehicle: Vehicle


def published(record: str) -> str:
    """The vehicle file of a record whose aircraft has none in tests/support/vehicles."""
    area, chord, span, mass, ixx, iyy, izz, ixz = _PUBLISHED[record]
    surfaces = "".join(
        f'[surfaces.{name}]\nlimits = ["-30 deg", "30 deg"]\n'
        for name in ("elevator", "aileron", "rudder")
    )
    return f"""name = "{record.split(chr(47))[0]}"
[reference]
area = {area}
chord = {chord}
span = {span}
[points]
moment_reference = "cg"
[mass]
mass = {mass}
cg = [0.0, 0.0, 0.0]
Ixx = {ixx}
Iyy = {iyy}
Izz = {izz}
Ixz = {ixz}
{surfaces}"""


def measured(folder: Path) -> Iterator[Pair]:
    """The measured records at `folder` with their vehicles."""
    attas = (VEHICLES / "attas.toml").read_text() + _SURFACES
    twin = (VEHICLES / "twin_otter.toml").read_text()
    texts = {
        **dict.fromkeys((*ATTAS, *STALLS), attas),
        **dict.fromkeys(TWIN_OTTER, twin),
        **{record: published(record) for record in _PUBLISHED},
    }
    for record, text in texts.items():
        recording = read_tabular(folder / record)
        mapping = choose_mapping(recording, builtin_mappings().values())
        vehicle = parse_vehicle(text)
        flight = map_recording(recording, mapping, vehicle, Path(record).stem)
        yield Pair(record, flag_unusable(flight), vehicle)


def simulated(flights: int = 3, seed: int = 4) -> Iterator[Pair]:
    """Flights of the built-in example as its instruments log them, and of the made-up aircraft of
    the tests of effects."""
    vehicle = parse_vehicle(read_example("vehicle.toml"))
    for log in mission.fly(seed=seed, flights=flights):
        topics = {topic.name: topic for topic in log.topics}
        recording = Recording(log.name, "ulog", "0" * 64, 0, topics, layout="px4")
        flight = map_recording(recording, builtin_mappings()["px4"], vehicle, recording.source)
        yield Pair(log.name, flag_unusable(flight), vehicle)
    other = effect_flights.vehicle()
    for number in range(flights):
        flight = effect_flights.flown(number, effect_flights.database())
        yield Pair(flight.id, flight, other)


def noticed(pair: Pair) -> tuple[str, ...]:
    """What is said about a flight with its vehicle."""
    size = pair.vehicle.reference
    first = suspicions(pair.flight, size.span, size.chord)
    return tuple(s.sentence for s in (*first, *against_vehicle(pair.flight, pair.vehicle)))


def determined(flight: Flight, vehicle: Vehicle, role: str) -> float:
    """How well a flight tells the effect of a role's surfaces: standard error over the estimate."""
    controls = by_role(flight, vehicle, ())
    axis = equation_errors(flight, vehicle, controls).get(role)
    fit = None if axis is None else axis.fit()
    best = float("inf")
    for name, control in controls.items():
        if fit is not None and control.role == role and name in fit.names:
            k = fit.names.index(name)
            best = min(best, float(fit.standard_errors[k] / abs(fit.estimates[k])))
    return best


Corruption = Callable[[Pair], Pair | None]


def _channels(pair: Pair, made: Mapping[str, Any]) -> Pair | None:
    if not made:
        return None
    flight = pair.flight.with_channels({n: np.asarray(v, float) for n, v in made.items()})
    return replace(pair, flight=add_combinations(flight, pair.vehicle))


def _surface(role: str, change: Callable[[np.ndarray, float], np.ndarray]) -> Corruption:
    """All channels of a role changed, if the flight tells the effect of the role to a fifth."""

    def corrupt(pair: Pair) -> Pair | None:
        if determined(pair.flight, pair.vehicle, role) > 0.2:
            return None
        names = _of_role(pair, role)
        return _channels(pair, {n: change(pair.flight[n], pair.flight.step) for n in names})

    return corrupt


def _of_role(pair: Pair, role: str) -> list[str]:
    """The logged channels of a role; none where the surfaces are shared by two roles."""
    word = {"pitch": "elevator", "roll": "aileron", "yaw": "rudder"}[role]
    combined = {f"delta_{name}" for name in pair.vehicle.combinations}
    names = [n for n in pair.flight.channels if word in n and n not in combined]
    if not names and role == "pitch":  # elevons: reversed together, both roles are
        names = [n for n in pair.flight.channels if "elevon" in n and n not in combined]
    return names


def _swapped(pair: Pair) -> Pair | None:
    flight = pair.flight
    told = [determined(flight, pair.vehicle, role) for role in ("roll", "yaw")]
    names = ("delta_aileron", "delta_rudder")
    if max(told) > 0.2 or any(n not in flight for n in names):
        return None
    if "delta_aileron_right" in flight:
        return _channels(
            pair,
            {
                "delta_aileron_right": flight["delta_rudder"],
                "delta_aileron_left": -flight["delta_rudder"],
                "delta_rudder": flight["delta_aileron"],
            },
        )
    return _channels(pair, {names[0]: flight[names[1]], names[1]: flight[names[0]]})


def _shifted(seconds: float) -> Callable[[np.ndarray, float], np.ndarray]:
    def shift(values: np.ndarray, step: float) -> np.ndarray:
        index = np.arange(len(values)) - round(seconds / step)
        return values[np.clip(index, 0, len(values) - 1)]

    return shift


def _scaled(factor: float, *names: str) -> Corruption:
    def corrupt(pair: Pair) -> Pair | None:
        return _channels(pair, {n: factor * pair.flight[n] for n in names if n in pair.flight})

    return corrupt


def _replaced(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Corruption:
    def corrupt(pair: Pair) -> Pair | None:
        there = name in pair.flight
        return _channels(pair, {name: change(pair.flight[name])} if there else {})

    return corrupt


def _vehicle(change: Callable[[dict[str, Any]], bool | None]) -> Corruption:
    """A wrong vehicle file; of one whose mass properties are logged, the channels change alike."""

    def corrupt(pair: Pair) -> Pair | None:
        data = pair.vehicle.model_dump()
        logged = data["mass"]["source"] == "channels"
        names = ("mass", "cg_x", "cg_y", "cg_z", "Ixx", "Iyy", "Izz", "Ixz")
        if logged:
            flight = pair.flight
            data["mass"] |= {n: flight[n] for n in names if n in flight}
            data["mass"]["cg"] = [flight[n] for n in names[1:4] if n in flight]
        if change(data) is False:
            return None
        made = replace(pair)
        if logged:
            values = data["mass"]
            channels = {n: values[n] for n in names if n in values and n in pair.flight}
            made = replace(pair, flight=pair.flight.with_channels(channels))
            data["mass"] = pair.vehicle.model_dump()["mass"]
        try:
            return replace(made, vehicle=Vehicle.model_validate(data))
        except (InputError, ValueError):
            return None  # refused when it is read: noticed before

    return corrupt


def _mass(factor: float, *names: str) -> Corruption:
    def change(data: dict[str, Any]) -> None:
        data["mass"] |= {n: factor * data["mass"][n] for n in names}

    return _vehicle(change)


def _size(**factors: float) -> Corruption:
    def change(data: dict[str, Any]) -> None:
        data["reference"] |= {n: f * data["reference"][n] for n, f in factors.items()}

    return _vehicle(change)


def _exchanged_inertia(data: dict[str, Any]) -> None:
    mass = data["mass"]
    mass["Ixx"], mass["Izz"] = mass["Izz"], mass["Ixx"]


def _cg_sign(data: dict[str, Any]) -> bool:
    if data["points"]["moment_reference"] == "cg" or data["mass"]["source"] == "channels":
        return False
    x, y, z = data["mass"]["cg"]
    data["mass"]["cg"] = (-x, y, z)
    return abs(x) > 0.02 * data["reference"]["chord"]


FOOT, POUND, DEGREE = 0.3048, 0.45359237, np.pi / 180
MOMENTS = ("Ixx", "Iyy", "Izz", "Ixz")

#: Kinds of corruption of a log.
FLIGHTS: dict[str, Corruption] = {
    "elevator reversed": _surface("pitch", lambda d, _: -d),
    "aileron reversed": _surface("roll", lambda d, _: -d),
    "rudder reversed": _surface("yaw", lambda d, _: -d),
    "elevator in percent": _surface("pitch", lambda d, _: d / 0.44 * 100.0),
    "elevator in microseconds": _surface("pitch", lambda d, _: 1500.0 + d / 0.44 * 500.0),
    "elevator in degrees": _surface("pitch", lambda d, _: d / DEGREE),
    "elevator converted twice": _surface("pitch", lambda d, _: d * DEGREE),
    "aileron in degrees": _surface("roll", lambda d, _: d / DEGREE),
    "rudder converted twice": _surface("yaw", lambda d, _: d * DEGREE),
    "aileron and rudder swapped": _swapped,
    "elevator .3 s late": _surface("pitch", _shifted(0.3)),
    "elevator .3 s early": _surface("pitch", _shifted(-0.3)),
    "aileron .3 s late": _surface("roll", _shifted(0.3)),
    "rudder .3 s late": _surface("yaw", _shifted(0.3)),
    "elevator dead": _surface("pitch", lambda d, _: np.full_like(d, d[0])),
    "aileron dead": _surface("roll", lambda d, _: np.full_like(d, d[0])),
    "rudder dead": _surface("yaw", lambda d, _: np.full_like(d, d[0])),
    "density in slug/ft3": _scaled(1.0 / 515.379, "rho"),
    "density zero": _scaled(0.0, "rho"),
    "density and qbar of slug/ft3": _scaled(1.0 / 515.379, "rho", "qbar"),
    "temperature in degC": _replaced("temperature", lambda t: t - 273.15),
    "static pressure in hPa": _scaled(0.01, "static_pressure"),
    "airspeed in kt": _scaled(1.0 / 0.514444, "V"),
    "airspeed in kt, qbar with it": lambda pair: _channels(
        pair,
        {"V": pair.flight["V"] / 0.514444, "qbar": pair.flight["qbar"] / 0.514444**2},
    ),
    "qbar in psf": _scaled(1.0 / 47.88, "qbar"),
    "az in g": _scaled(1.0 / 9.80665, "az", "az_imu"),
    "az reversed": _scaled(-1.0, "az", "az_imu"),
    "alpha in degrees": _scaled(1.0 / DEGREE, "alpha"),
    "q reversed": _scaled(-1.0, "q"),
}
#: Kinds of wrong vehicle files.
FILES: dict[str, Corruption] = {
    "mass in lb": _mass(1.0 / POUND, "mass"),
    "mass in g": _mass(1000.0, "mass"),
    "mass in slug": _mass(1.0 / 14.5939, "mass"),
    "mass infinite": _mass(np.inf, "mass"),
    "inertia in slug ft2": _mass(1.0 / 1.35582, *MOMENTS),
    "inertia in lb ft2": _mass(1.0 / 0.04214, *MOMENTS),
    "inertia in g cm2": _mass(1e7, *MOMENTS),
    "Ixx ten times": _mass(10.0, "Ixx"),
    "Ixx a tenth": _mass(0.1, "Ixx"),
    "Iyy ten times": _mass(10.0, "Iyy"),
    "Iyy a tenth": _mass(0.1, "Iyy"),
    "Izz ten times": _mass(10.0, "Izz"),
    "Izz a tenth": _mass(0.1, "Izz"),
    "Ixx and Izz exchanged": _vehicle(_exchanged_inertia),
    "CG of the other sign": _vehicle(_cg_sign),
    "area in ft2": _size(area=1.0 / FOOT**2),
    "area ten times": _size(area=10.0),
    "chord in ft": _size(chord=1.0 / FOOT),
    "span in ft": _size(span=1.0 / FOOT),
    "half span": _size(span=0.5),
    "all lengths in ft": _size(area=1.0 / FOOT**2, chord=1.0 / FOOT, span=1.0 / FOOT),
    "all lengths in inch": _size(area=1.0 / 0.0254**2, chord=1.0 / 0.0254, span=1.0 / 0.0254),
}


@dataclass
class Count:
    """Where a kind was noticed and where not; what was refused counts as noticed."""

    noticed: list[str]
    silent: list[str]


def attack(pairs: list[Pair], kinds: Mapping[str, Corruption]) -> dict[str, Count]:
    """Apply every kind to every flight."""
    table = {}
    for kind, corrupt in kinds.items():
        count = Count([], [])
        for pair in pairs:
            with np.errstate(all="ignore"):
                made = corrupt(pair)
            if made is not None:
                (count.noticed if noticed(made) else count.silent).append(pair.name)
        table[kind] = count
    return table


def other_aircraft(pairs: list[Pair]) -> Count:
    """Every flight under the vehicle file of another aircraft with mass properties of its own."""
    files = {p.vehicle.name: p.vehicle for p in pairs if p.vehicle.mass.source == "constant"}
    count = Count([], [])
    for pair in pairs:
        for name, vehicle in files.items():
            if vehicle.reference != pair.vehicle.reference:
                made = replace(pair, vehicle=vehicle)
                (count.noticed if noticed(made) else count.silent).append(f"{pair.name} as {name}")
    return count


def main() -> None:
    """Print the table for the measured and the simulated flights."""
    folder = Path(os.environ.get("AERODB_TEST_DATA", ROOT.parent / "shared" / "data"))
    pairs = [*measured(folder), *simulated()]
    print("right flights:", len(pairs))
    for pair in pairs:
        for sentence in noticed(pair):
            print(f"  FALSE ALARM {pair.name}: {sentence}")
    silent = total = 0
    for title, kinds in (("corrupted flights", FLIGHTS), ("wrong vehicle files", FILES)):
        print(f"{title}: noticed, silent")
        table = attack(pairs, kinds)
        if kinds is FILES:
            table["another aircraft's log"] = other_aircraft(pairs)
        for kind, count in table.items():
            silent, total = silent + len(count.silent), total + len(count.silent + count.noticed)
            names = ", ".join(Path(name).stem for name in count.silent)
            print(f"  {kind:32} {len(count.noticed):4} {len(count.silent):4}  {names}")
    print(f"silent: {silent} of {total} ({100 * silent / total:.1f} %)")


if __name__ == "__main__":
    main()
