"""Sensors and surfaces that fail during a flight: from one time on, or for a while.

``python -m tests.campaigns.failing`` prints a table over the right flights of
`tests.campaigns.corrupted`: kind -> flights in which it matters, told with the right channel, left
out without a word, silent, and wrong causes; and the false alarms of the right flights.
"""

import argparse
import os
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from aerodb.conditioning import AIR, flag_unusable
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS
from aerodb.suspicions.failed import FAILED, failed_suspicions
from aerodb.vehicle import add_combinations
from tests.campaigns.corrupted import fleet, measured, noticed, simulated
from tests.campaigns.corruptions import Pair, determined, of_role
from tests.support.paths import ROOT

#: Values of a channel, the mask of the samples in which it fails, noise of its sensor, step [s].
Change = Callable[[np.ndarray, np.ndarray, np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class Kind:
    """A failure: the channels that it makes wrong alike, how, and for which part of the flight.

    adds : whether it shows also where the channel would not have moved.
    """

    channels: tuple[str, ...]
    change: Change
    begin: float = 0.5
    seconds: float | None = None
    adds: bool = False


def _held(values: np.ndarray, failing: np.ndarray, noise: np.ndarray, step: float) -> np.ndarray:
    return np.where(failing, values[np.argmax(failing)], values)


def _zero(values: np.ndarray, failing: np.ndarray, noise: np.ndarray, step: float) -> np.ndarray:
    return np.where(failing, 0.0, values)


def _noise(values: np.ndarray, failing: np.ndarray, noise: np.ndarray, step: float) -> np.ndarray:
    """Held, with the noise of the sensor."""
    return np.where(failing, values[np.argmax(failing)] + noise, values)


def _nothing(values: np.ndarray, failing: np.ndarray, noise: np.ndarray, step: float) -> np.ndarray:
    return np.where(failing, np.nan, values)


def _decays(values: np.ndarray, failing: np.ndarray, noise: np.ndarray, step: float) -> np.ndarray:
    """Falls off to a tenth within 8 s."""
    since = np.cumsum(failing) * step
    return np.where(failing, values * np.clip(1.0 - since / 8.0, 0.1, 1.0), values)


def _drops(values: np.ndarray, failing: np.ndarray, noise: np.ndarray, step: float) -> np.ndarray:
    """Zero for 2 s of every 4 s."""
    return np.where(failing & (np.arange(len(values)) * step % 4.0 < 2.0), 0.0, values)


def _leaps(by: float) -> Change:
    """Elsewhere from then on, following as before [unit of the channel]."""
    return lambda values, failing, noise, step: np.where(failing, values + by, values)


def _drifts(by: float) -> Change:
    """Away evenly, by so much until the end of the failure [unit of the channel]."""

    def change(
        values: np.ndarray, failing: np.ndarray, noise: np.ndarray, step: float
    ) -> np.ndarray:
        return values + by * np.cumsum(failing) / max(int(failing.sum()), 1) * failing

    return change


def _loses(share: float) -> Change:
    """A share of the value is lost, evenly until the end of the failure."""

    def change(
        values: np.ndarray, failing: np.ndarray, noise: np.ndarray, step: float
    ) -> np.ndarray:
        return values * (1.0 - share * np.cumsum(failing) / max(int(failing.sum()), 1) * failing)

    return change


def _spikes(sizes: float) -> Change:
    """Every 50th sample off by a multiple of the channel's standard deviation."""

    def change(
        values: np.ndarray, failing: np.ndarray, noise: np.ndarray, step: float
    ) -> np.ndarray:
        hit = failing & (np.arange(len(values)) % 50 == 0)
        return np.where(hit, values + sizes * float(np.nanstd(values)), values)

    return change


DEGREE = float(np.pi / 180.0)
_GROUND_VELOCITY = ("velocity_north", "velocity_east")
KINDS: dict[str, Kind] = {
    "airspeed zero": Kind(AIR, _zero),
    "airspeed zero for 5 s": Kind(AIR, _zero, 0.4, 5.0),
    "airspeed held": Kind(AIR, _held),
    "airspeed held 3 s": Kind(AIR, _held, 0.4, 3.0),
    "airspeed falls off": Kind(AIR, _decays),
    "airspeed not a number": Kind(AIR, _nothing),
    "alpha zero": Kind(("alpha",), _zero),
    "alpha held": Kind(("alpha",), _held),
    "alpha held, noisy": Kind(("alpha",), _noise),
    "alpha held 3 s": Kind(("alpha",), _held, 0.4, 3.0),
    "alpha not a number": Kind(("alpha",), _nothing),
    "beta held, noisy": Kind(("beta",), _noise),
    "altitude held": Kind(("altitude",), _held),
    "altitude drops to zero": Kind(("altitude",), _drops),
    "altitude leaps": Kind(("altitude",), _leaps(150.0)),
    "static pressure held": Kind(("static_pressure",), _held),
    "static pressure leaps": Kind(("static_pressure",), _leaps(-2000.0)),
    "velocity held": Kind(("velocity_north", "velocity_east"), _held),
    "velocity zero": Kind(("velocity_north", "velocity_east"), _zero),
    "position held": Kind(("north", "east"), _held),
    "position leaps": Kind(("north", "east"), _leaps(300.0)),
    "alpha drops to zero": Kind(("alpha",), _drops),
    "airspeed zero for 15 s": Kind(AIR, _zero, 0.4, 15.0),
    "airspeed held 15 s": Kind(AIR, _held, 0.4, 15.0),
    "alpha held, noisy, 15 s": Kind(("alpha",), _noise, 0.4, 15.0),
    "altitude held 20 s": Kind(("altitude",), _held, 0.4, 20.0),
    "velocity held 15 s": Kind(_GROUND_VELOCITY, _held, 0.4, 15.0),
    "airspeed spikes": Kind(AIR, _spikes(5.0), adds=True),
    "alpha spikes": Kind(("alpha",), _spikes(5.0), adds=True),
    "altitude spikes": Kind(("altitude",), _spikes(5.0), adds=True),
    "velocity spikes": Kind(_GROUND_VELOCITY, _spikes(5.0), adds=True),
    "altitude drifts 100 m": Kind(("altitude",), _drifts(100.0), adds=True),
    "static pressure drifts 10 hPa": Kind(("static_pressure",), _drifts(1000.0), adds=True),
    "position drifts 200 m": Kind(("north", "east"), _drifts(200.0), adds=True),
    "airspeed loses .4": Kind(("V", "calibrated_airspeed"), _loses(0.4), adds=True),
    "theta drifts 8 deg": Kind(("theta",), _drifts(8.0 * DEGREE), adds=True),
    "phi drifts 10 deg": Kind(("phi",), _drifts(10.0 * DEGREE), adds=True),
    "psi drifts 20 deg": Kind(("psi",), _drifts(20.0 * DEGREE), adds=True),
    "alpha drifts 6 deg": Kind(("alpha",), _drifts(6.0 * DEGREE), adds=True),
    "beta drifts 6 deg": Kind(("beta",), _drifts(6.0 * DEGREE), adds=True),
    "alpha leaps 6 deg": Kind(("alpha",), _leaps(6.0 * DEGREE), adds=True),
    "alpha leaps 6 deg for 10 s": Kind(("alpha",), _leaps(6.0 * DEGREE), 0.4, 10.0, adds=True),
    "beta leaps 6 deg": Kind(("beta",), _leaps(6.0 * DEGREE), adds=True),
    "theta leaps 8 deg": Kind(("theta",), _leaps(8.0 * DEGREE), adds=True),
    "phi leaps 10 deg for 10 s": Kind(("phi",), _leaps(10.0 * DEGREE), 0.4, 10.0, adds=True),
    "theta held": Kind(("theta",), _held),
    "phi held, noisy": Kind(("phi",), _noise),
}


@dataclass
class Told:
    """Flights of a kind by what is noticed of them."""

    right: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    silent: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    @property
    def cases(self) -> int:
        return len(self.right) + len(self.left_out) + len(self.silent)


#: Surfaces that change from the middle of what they do: the role, and what is logged from then on.
SURFACES: dict[str, tuple[str, Callable[[np.ndarray], np.ndarray]]] = {
    "elevator reversed": ("pitch", lambda d: -d),
    "aileron reversed": ("roll", lambda d: -d),
    "rudder reversed": ("yaw", lambda d: -d),
    "elevator x .4": ("pitch", lambda d: 0.4 * d),
    "elevator x 2.5": ("pitch", lambda d: 2.5 * d),
    "aileron x .4": ("roll", lambda d: 0.4 * d),
    "rudder x .4": ("yaw", lambda d: 0.4 * d),
    "elevator held": ("pitch", lambda d: np.full_like(d, d[0])),
    "aileron held": ("roll", lambda d: np.full_like(d, d[0])),
    "rudder held": ("yaw", lambda d: np.full_like(d, d[0])),
}


def changed(pair: Pair, kind: str) -> Pair | None:
    """The flight with the surfaces of a role changed from where half of their motion is over; None
    where the flight does not tell their effect to a fifth in each half."""
    role, change = SURFACES[kind]
    flight = pair.flight
    names = of_role(pair, role)
    if not names:
        return None
    good = flight.usable(names)
    effort = np.cumsum(np.where(good, np.gradient(flight[names[0]]), 0.0) ** 2)
    place = int(np.searchsorted(effort, 0.5 * effort[-1]))
    for half in (slice(0, place), slice(place, None)):
        part = replace(
            flight,
            time=flight.time[half],
            channels={name: values[half] for name, values in flight.channels.items()},
            flags={name: bits[half] for name, bits in flight.flags.items()},
        )
        if len(part.time) < 100 or not determined(part, pair.vehicle, role) < 0.2:
            return None
    made = {n: np.r_[flight[n][:place], change(flight[n][place:])] for n in names}
    return replace(pair, flight=add_combinations(flight.with_channels(made), pair.vehicle))


def told_of_surfaces(pairs: Sequence[Pair], kind: str) -> Told:
    """What is noticed at ingest of surfaces that change: the right one, another, or nothing."""
    found = Told()
    for pair in pairs:
        with np.errstate(all="ignore"):
            made = changed(pair, kind)
            if made is None:
                continue
            said = {each.channel for each in noticed(made)}
        role = SURFACES[kind][0]
        word = {"pitch": "elevator", "roll": "aileron", "yaw": "rudder"}[role]
        stems = {n.removesuffix("_right").removesuffix("_left") for n in of_role(pair, role)}
        right = any(each.startswith((f"delta_{word}", *stems)) for each in said)
        (found.right if right else found.left_out if said else found.silent).append(pair.name)
        if said and not right:
            found.wrong.append(f"{pair.name}: {', '.join(sorted(said))}")
    return found


def failing(pair: Pair, kind: Kind) -> tuple[Flight, np.ndarray] | None:
    """The flight with the failure, conditioned anew, and where it fails; None where the flight has
    no such channel, or none that moves by ten times its noise meanwhile."""
    flight = pair.flight
    names = [name for name in kind.channels if name in flight]
    flown = np.flatnonzero(flight.usable(names))
    if not names or flown.size < 100:
        return None
    first = int(flown[int(kind.begin * flown.size)])
    count = flown[-1] + 1 - first if kind.seconds is None else round(kind.seconds / flight.step)
    where = np.zeros(len(flight.time), dtype=bool)
    where[first : min(first + count, flown[-1] + 1)] = True
    rng = np.random.default_rng(zlib.crc32(pair.name.encode()))
    made = {}
    for name in names:
        values = flight[name]
        sigma = 1.4826 * float(np.nanmedian(np.abs(np.diff(values, 2)))) / np.sqrt(6.0)
        here = values[where & np.isfinite(values)]
        moves = kind.adds or np.std(here) > 10.0 * sigma + 1e-9
        if name == names[0] and not moves:
            return None
        made[name] = kind.change(
            values, where, sigma * rng.standard_normal(len(values)), flight.step
        )
    bits = {
        name: flags & ~flags.dtype.type(FLAGS["stuck"] | FLAGS["wild_point"] | FLAGS["on_ground"])
        for name, flags in flight.flags.items()
    }
    return flag_unusable(replace(flight, flags=bits).with_channels(made)), where


def told(pairs: Sequence[Pair], kind: Kind) -> Told:
    """What is noticed of a kind over all flights."""
    found = Told()
    for pair in pairs:
        with np.errstate(all="ignore"):
            made = failing(pair, kind)
        if made is None:
            continue
        flight, where = made
        said = failed_suspicions(flight)
        named = {each.channel for each in said}
        first = next(name for name in kind.channels if name in flight)
        where &= flight[first] != pair.flight[first]
        still = flight.usable([first]) & where
        if named & set(kind.channels):
            found.right.append(pair.name)
        elif np.mean(still[where]) < 0.2:
            found.left_out.append(pair.name)
        else:
            found.silent.append(pair.name)
        if named - set(kind.channels):
            found.wrong.append(pair.name)
    return found


def false_alarms(pairs: Sequence[Pair]) -> Iterator[tuple[str, str]]:
    """Right flights in which a sensor is said to have failed."""
    for pair in pairs:
        for each in failed_suspicions(flag_unusable(pair.flight)):
            if each.kind == FAILED:
                yield pair.name, each.sentence


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cache", type=Path, help="folder of JSBSim's flights")
    parser.add_argument("--only", help="one kind")
    parser.add_argument("--without-fleet", action="store_true", help="no flights of JSBSim")
    parser.add_argument("--surfaces", action="store_true", help="surfaces in place of sensors")
    asked = parser.parse_args()
    cache = asked.cache or Path(tempfile.mkdtemp())
    cache.mkdir(parents=True, exist_ok=True)
    folder = Path(os.environ.get("AERODB_TEST_DATA", ROOT.parent / "shared" / "data"))
    pairs = [*measured(folder), *simulated()]
    pairs += [] if asked.without_fleet else [*fleet(cache)]
    alarms = list(false_alarms(pairs))
    print(f"right flights: {len(pairs)}, false alarms: {len(alarms)}", *alarms, sep="\n  ")
    kinds: Mapping[str, Kind] = {asked.only: KINDS[asked.only]} if asked.only else KINDS
    tables = {name: lambda kind=kind: told(pairs, kind) for name, kind in kinds.items()}
    if asked.surfaces:
        tables = {name: lambda name=name: told_of_surfaces(pairs, name) for name in SURFACES}
        for pair in pairs:
            with np.errstate(all="ignore"):
                for each in noticed(pair):
                    print(f"  FALSE ALARM {pair.name}: {each.sentence}")
    for name, table in tables.items():
        found = table()
        numbers = (found.cases, found.right, found.left_out, found.silent, found.wrong)
        words = " ".join(f"{n if isinstance(n, int) else len(n):4}" for n in numbers)
        silent = ", ".join(Path(each).stem for each in found.silent)
        print(f"  {name:26} {words}  {silent}", flush=True)


if __name__ == "__main__":
    main()
