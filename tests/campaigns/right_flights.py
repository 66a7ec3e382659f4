"""Right flights under conditions that no check was made with: a suspicion of one is a false alarm.

The vehicle, the database and the sensors are right; what differs is the air, the sampling, the
resolution, the errors that instruments have, and what is flown.
"""

import contextlib
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from aerodb.conditioning import flag_unusable
from aerodb.examples.phoenix import mission, read_example
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.nomenclature import is_surface
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.tabular import read_tabular
from aerodb.tables import parse
from aerodb.vehicle import parse_vehicle
from tests.campaigns.corruptions import Pair
from tests.campaigns.databases import database_of
from tests.campaigns.fleet import CONDITIONS, NO_BODIES, airframe, vehicle_text
from tests.campaigns.instruments import CELLS, biases_of, noise_of, shown
from tests.campaigns.runs import channels_of
from tests.support import effect_flights, six_surfaces
from tests.support.small_glider import write_csv

Log = dict[str, np.ndarray]
DEGREE = np.pi / 180.0
#: Steps of a coarse logger: a tenth of what flights of the campaign move.
STEPS: Mapping[str, float] = {
    "alpha": 0.2 * DEGREE, "beta": 0.2 * DEGREE, "phi": 0.5 * DEGREE, "theta": 0.5 * DEGREE,
    "psi": 0.5 * DEGREE, "p": 0.25 * DEGREE, "q": 0.25 * DEGREE, "r": 0.25 * DEGREE,
    "ax_imu": 0.05, "ay_imu": 0.05, "az_imu": 0.05, "V": 0.25, "qbar": 25.0, "altitude": 1.0,
}  # fmt: skip
SURFACE_STEP = 0.25 * DEGREE
#: Cell of instruments, what is done to the log, number of the flight.
Condition = tuple[str, Callable[[Log], Log], int]


def coarse(log: Log) -> Log:
    """Channels in the steps of a coarse logger."""
    steps = {name: SURFACE_STEP if is_surface(name) else STEPS.get(name) for name in log}
    return {
        name: values if (step := steps[name]) is None else step * np.round(values / step)
        for name, values in log.items()
    }


def as_it_is(log: Log) -> Log:
    """The log."""
    return log


CONDITIONS_FLOWN: Mapping[str, Condition] = {
    "another flight": ("declared", as_it_is, 2),
    "a third one": ("declared", as_it_is, 3),
    "coarse": ("declared", coarse, 2),
    "10 Hz": ("10 Hz", as_it_is, 5),
    "moderate turbulence": ("moderate turbulence", as_it_is, 4),
    "severe turbulence": ("severe turbulence", as_it_is, 6),
    "alpha 5x": ("alpha 5x", as_it_is, 3),
    "rates 5x": ("rates 5x", as_it_is, 2),
    "air data 5x": ("air data 5x", as_it_is, 3),
    "biases 3x": ("biases 3x", as_it_is, 2),
    "vanes 50 ms late": ("vanes 50 ms late", as_it_is, 3),
}


def jsbsim(cache: Path, name: str, condition: str, seed: int = 41) -> Pair:
    """A flight of one of JSBSim's aircraft, which obeys its own database.

    cache : folder of flights that were flown before. Raises RuntimeError where it does not trim, or
    leaves its envelope.
    """
    kind, change, number = CONDITIONS_FLOWN[condition]
    craft, cell = airframe(name), CELLS[kind]
    vehicle = parse_vehicle(vehicle_text(craft) + cell.more)
    channels = channels_of(craft, number, cell, cache)
    rng = np.random.default_rng([seed, zlib.crc32(f"{name} {condition}".encode())])
    noise = noise_of(cell, tuple(channels), len(channels["V"]), rng)
    log = change(shown(channels, noise, biases_of(cell, rng), cell))
    time = cell.step * np.arange(len(log["V"]))
    place = write_csv(cache / f"right-{craft.vehicle}.csv", {"time": time, **log})
    recording = read_tabular(place)
    mapping = choose_mapping(recording, builtin_mappings().values())
    flight = map_recording(recording, mapping, vehicle, f"{name}, {condition}")
    return Pair(flight.id, flag_unusable(flight), vehicle, craft.database())


def others(flights: int, seed: int = 41) -> Iterator[Pair]:
    """Other flights of the built-in example, of the aircraft with all effects, and of a small jet
    with six surfaces and noise."""
    vehicle = parse_vehicle(read_example("vehicle.toml"))
    for log in mission.fly(seed=seed, flights=flights):
        topics = {topic.name: topic for topic in log.topics}
        recording = Recording(log.name, "ulog", "0" * 64, 0, topics, layout="px4")
        flight = map_recording(recording, builtin_mappings()["px4"], vehicle, recording.source)
        yield Pair(f"example {log.name}", flag_unusable(flight), vehicle, database_of(vehicle))
    other = effect_flights.vehicle()
    for flight in effect_flights.flown_together(
        range(seed, seed + flights), effect_flights.database()
    ):
        yield Pair(f"effects {flight.id}", flight, other, database_of(other))
    jet = six_surfaces.vehicle()
    for number in range(seed, seed + flights):
        flight = six_surfaces.leg(number, six_surfaces.database())
        yield Pair(f"jet {flight.id}", flight, jet, six_surfaces.database())


def right_flights(cache: Path, flights: int = 4) -> Iterator[Pair]:
    """All of them; an aircraft that leaves its envelope in severe turbulence flies no such one."""
    yield from others(flights)
    for condition in CONDITIONS_FLOWN:
        for name in sorted(CONDITIONS.keys() - NO_BODIES):
            with contextlib.suppress(RuntimeError):
                yield jsbsim(cache, name, condition)


def scattered(pair: Pair, share: float, seed: int) -> Pair:
    """A right flight beside a database whose every term is wrong by a normal share, one sigma of
    which is `share`: a wind tunnel's."""
    rng, database = np.random.default_rng(seed), pair.database
    assert database is not None
    terms = tuple(
        replace(term, expression=parse(f"{factor!r}*({term.expression})"))
        for term in database.terms
        for factor in [float(1.0 + share * rng.standard_normal())]
    )
    named = f"{pair.name}, terms {share:.0%} wrong"
    return replace(pair, name=named, database=replace(database, terms=terms))
