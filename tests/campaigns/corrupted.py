"""What checks notice of corrupted flights and wrong vehicle files, and of right ones.

``python -m tests.campaigns.corrupted`` prints a table: kind of corruption -> how many are said at
ingest, said by the comparison with the vehicle's database, refused there (the log lacks what the
database needs), silent, and silent with an axis at twice the clean residual and the verdict of
the reconstruction that the right flight has (material); of those said, how many are only suspected, and of which no suspicion names what is wrong (misnamed).
``--cache FOLDER`` keeps the flights of JSBSim; ``--only`` runs one part: corrupted flights, wrong vehicle files, files whose
every value is believable, wrong databases (``databases``: one flight of each vehicle; the first
column is what is said at import), faults during a flight (``during``: a silent one counts where
the verdict of the reconstruction and its reasons stay and an axis has twice the clean residual;
misnamed is a fault of which no suspicion names what is wrong), right flights beside databases that
lack an effect, or right flights under other conditions (``right``).
"""

import argparse
import itertools
import os
import tempfile
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import total_coefficients
from aerodb.conditioning import Suspicion, flag_unusable
from aerodb.consistency import make_consistent
from aerodb.errors import InputError
from aerodb.examples.phoenix import mission, read_example
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.nomenclature import AXES
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.tabular import read_tabular
from aerodb.suspicions import against_database, against_vehicle, limits_flight
from aerodb.suspicions.failed import failed_suspicions
from aerodb.suspicions.plausibility import suspicions
from aerodb.tables import lacking_effects, unusual_content
from aerodb.vehicle import parse_vehicle
from tests.campaigns.corruptions import BELIEVABLE, FILES, FLIGHTS, Corruption, Pair, is_field_named
from tests.campaigns.databases import database_of
from tests.campaigns.during_flight import SENSORS, SURFACES, is_named
from tests.campaigns.fleet import CONDITIONS, NO_BODIES, airframe, vehicle_text
from tests.campaigns.instruments import CELLS, noise_of, shown
from tests.campaigns.planted import PLANTED, NotThere
from tests.campaigns.right_flights import right_flights, scattered
from tests.campaigns.runs import channels_of
from tests.campaigns.wrong_databases import DATABASES
from tests.support import effect_flights
from tests.support.measured_flights import ATTAS, CITATION, HFB320, STALLS, TWIN_OTTER
from tests.support.paths import ROOT, VEHICLES
from tests.support.small_glider import write_csv

#: Relative difference of reference lengths and area that is said at import
#: (`aerodb.tasks.steps.inputs`).
SAME_SIZE = 0.05
#: Least residual that matters, as a share of what was flown of an axis: simulated flights that obey
#: their database to rounding have none.
LEAST_LEFT = 0.03
_SURFACES = "".join(
    f'[surfaces.{name}]\nlimits = ["-30 deg", "30 deg"]\n'
    for name in ("aileron_left", "aileron_right", "rudder")
)
#: DLR HFB-320 and Cessna Citation as published (SOURCE.md beside the data); inertias are estimates.
_PUBLISHED = {
    HFB320: (30.1, 2.43, 14.49, 7472.0, 30000.0, 91400.0, 110000.0, 2000.0),
    CITATION: (30.0, 2.0569, 15.911, 6000.0, 28000.0, 34000.0, 60000.0, 100.0),
}


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
        yield Pair(record, flag_unusable(flight), vehicle, database_of(vehicle))


def simulated(flights: int = 4, seed: int = 4) -> Iterator[Pair]:
    """Flights of the built-in example as its instruments log them, and of the made-up aircraft of
    the tests of effects."""
    vehicle = parse_vehicle(read_example("vehicle.toml"))
    for log in mission.fly(seed=seed, flights=flights):
        topics = {topic.name: topic for topic in log.topics}
        recording = Recording(log.name, "ulog", "0" * 64, 0, topics, layout="px4")
        flight = map_recording(recording, builtin_mappings()["px4"], vehicle, recording.source)
        yield Pair(log.name, flag_unusable(flight), vehicle, database_of(vehicle))
    other = effect_flights.vehicle()
    for number in range(flights):
        flight = effect_flights.flown(number, effect_flights.database())
        yield Pair(flight.id, flight, other, database_of(other))


def fleet(
    cache: Path,
    flights: int = 2,
    aircraft: Collection[str] = CONDITIONS.keys() - NO_BODIES,
    first: int = 0,
) -> Iterator[Pair]:
    """Flights of JSBSim's aircraft, with the noise of their instruments and their own databases;
    first : number of the first flight."""
    cell = CELLS["declared"]
    for name in sorted(aircraft):
        craft = airframe(name)
        vehicle, database = parse_vehicle(vehicle_text(craft)), craft.database()
        for number in range(first, first + flights):
            channels = channels_of(craft, number, cell, cache)
            rng = np.random.default_rng([number, zlib.crc32(name.encode())])
            noise = noise_of(cell, tuple(channels), len(channels["V"]), rng)
            log = shown(channels, noise, {}, cell)
            time = cell.step * np.arange(len(log["V"]))
            place = write_csv(cache / f"{craft.vehicle}-{number}.csv", {"time": time, **log})
            recording = read_tabular(place)
            mapping = choose_mapping(recording, builtin_mappings().values())
            flight = map_recording(recording, mapping, vehicle, place.stem)
            yield Pair(place.stem, flag_unusable(flight), vehicle, database)


def lacking(pairs: Sequence[Pair]) -> Iterator[Pair]:
    """Right flights of JSBSim's aircraft beside databases that lack an effect, each of `PLANTED`."""
    names = {name.lower(): name for name in CONDITIONS}
    for pair in pairs:
        if pair.vehicle.name not in names:
            continue
        craft = airframe(names[pair.vehicle.name])
        for effect, planted in PLANTED.items():
            try:
                database = craft.database(planted.file(craft), planted.bindings_of(craft))
            except NotThere:
                continue
            yield replace(pair, name=f"{pair.name} without {effect}", database=database)


def noticed(pair: Pair) -> tuple[Suspicion, ...]:
    """What is said at ingest about a flight with its vehicle."""
    size = pair.vehicle.reference
    first = suspicions(pair.flight, size.span, size.chord)
    return (*first, *against_vehicle(pair.flight, pair.vehicle))


def noticed_beside(pair: Pair) -> tuple[Suspicion, ...]:
    """What the comparison with the vehicle's database says, as its step makes it.

    Raises InputError where it refuses.
    """
    flight, database, vehicle = pair.flight, pair.database, pair.vehicle
    if database is None:
        return ()
    compared = compare(flight, total_coefficients(flight, vehicle), database, vehicle.reference)
    return against_database(*compared.beside(flight, database), vehicle)


def residuals(pair: Pair) -> dict[str, tuple[float, float]]:
    """Axis -> rms of what the database leaves of it, and of what was flown; empty where the
    comparison refuses."""
    if pair.database is None:
        return {}
    coefficients = total_coefficients(pair.flight, pair.vehicle)
    try:
        made = compare(pair.flight, coefficients, pair.database, pair.vehicle.reference)
    except InputError:
        return {}
    found = {}
    for axis in AXES:
        if axis not in made.measured:
            continue
        rest = (made.measured[axis] - made.predicted[axis])[made.usable[axis]]
        flown = float(np.nanstd(made.measured[axis][made.usable[axis]]))
        found[axis] = (float(np.sqrt(np.nanmean(rest**2))), flown)
    return found


def is_material(right: Pair, wrong: Pair) -> bool:
    """Whether an axis has at least twice the residual of the right flight."""
    before, after = residuals(right), residuals(wrong)
    return any(
        left > 2.0 * max(before[axis][0], LEAST_LEFT * before[axis][1])
        for axis, (left, _) in after.items()
        if axis in before
    )


def said_during(wrong: Pair) -> list[Suspicion]:
    """What is said of a fault during a flight: at ingest, or else beside the database."""
    found = [*failed_suspicions(wrong.flight), *noticed(wrong)]
    return found or list(noticed_beside(wrong))


def keeps_verdict(right: Pair, wrong: Pair) -> bool:
    """Whether the reconstruction of a wrong flight has the verdict of the right one, and no reason
    beside those of the right one."""
    before, after = (
        make_consistent(each.flight, each.vehicle, None).document for each in (right, wrong)
    )
    known, found = (
        {(each["kind"], *each["subjects"]) for each in document["verdict_remarks"]}
        for document in (before, after)
    )
    return bool(before["verdict"] == after["verdict"] and found <= known)


@dataclass
class During:
    """Faults during a flight: how many, how many of them matter, which of these are silent, how
    many said, and of which of these no suspicion names what is wrong."""

    cases: int = 0
    material: int = 0
    silent: list[str] = field(default_factory=list)
    said: int = 0
    misnamed: list[str] = field(default_factory=list)


def during(pairs: Sequence[Pair], kind: str, most: int) -> During:
    """One kind, in at most so many flights."""
    corrupt = {**SURFACES, **SENSORS}[kind]
    found = During()
    for pair in pairs:
        with np.errstate(all="ignore"):
            made = corrupt(pair) if found.cases < most else None
            if made is None:
                continue
            found.cases += 1
            if not is_material(pair, made):
                continue
            found.material += 1
            try:
                said = said_during(made)
            except InputError:  # the comparison refuses
                continue
            if said:
                found.said += 1
                found.misnamed += [] if names_it(pair, made, said) else [pair.name]
            elif keeps_verdict(pair, made):
                found.silent += [pair.name]
    return found


@dataclass
class Count:
    """Where a kind was noticed at ingest, beside the database, by a refusal of the comparison, and
    where it was silent; what of the first two was only suspected, what of it names nothing that is
    wrong; and what of the silent ones is material."""

    ingest: list[str] = field(default_factory=list)
    beside: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    silent: list[str] = field(default_factory=list)
    suspected: list[str] = field(default_factory=list)
    misnamed: list[str] = field(default_factory=list)
    material: list[str] = field(default_factory=list)

    @property
    def cases(self) -> int:
        return len(self.ingest) + len(self.beside) + len(self.refused) + len(self.silent)

    def add(self, name: str, right: Pair, wrong: Pair) -> None:
        with np.errstate(all="ignore"):
            found, place = noticed(wrong), self.ingest
            if not found:
                try:
                    found, place = noticed_beside(wrong), self.beside
                except InputError:
                    return self.refused.append(name)
            if not found and is_material(right, wrong) and keeps_verdict(right, wrong):
                self.material.append(name)
        (place if found else self.silent).append(name)
        if found and not any(limits_flight(each) for each in found):
            self.suspected.append(name)
        if found and not names_it(right, wrong, found):
            self.misnamed.append(name)


def names_it(right: Pair, wrong: Pair, found: Iterable[Suspicion]) -> bool:
    """Whether a suspicion names a channel or a field of the vehicle file that is wrong."""
    said = [f"{each.channel} {each.sentence}" for each in found]
    return any(
        is_named(right, wrong, words) or is_field_named(right, wrong, words) for words in said
    )


def said_at_import(right: Pair, wrong: Pair) -> bool:
    """Whether what no aircraft has is said of a wrong database when it is imported, or what it
    lacks, or that its reference lengths are not those of the vehicle file."""
    assert right.database is not None
    assert wrong.database is not None
    mass = wrong.vehicle.mass
    cg: Any = mass.cg if mass.source == "constant" else None
    sizes = [
        (getattr(wrong.database.reference, name), getattr(wrong.vehicle.reference, name))
        for name in ("area", "chord", "span")
    ]
    lacking = {*lacking_effects(wrong.database)} - {*lacking_effects(right.database)}
    return bool(
        unusual_content(wrong.database, cg)
        or lacking
        or any(abs(one / other - 1.0) > SAME_SIZE for one, other in sizes)
    )


def attack_databases(pairs: Sequence[Pair]) -> dict[str, Count]:
    """Apply every kind to the database of every vehicle, beside the first of its flights to which
    the kind applies; what changes no coefficient is no case."""
    table = {}
    for kind, corrupt in DATABASES.items():
        table[kind], done = Count(), set[str]()
        for pair in pairs:
            made = corrupt(pair) if pair.vehicle.name not in done else None
            if made is None:
                continue
            done.add(pair.vehicle.name)
            if said_at_import(pair, made):
                table[kind].ingest.append(pair.name)
            elif beside(table[kind], made) is None and not is_material(pair, made):
                table[kind].silent.pop()
    return table


def beside(count: Count, pair: Pair) -> bool | None:
    """Count what is said of a pair beside its database; None where it is silent."""
    with np.errstate(all="ignore"):
        try:
            found = noticed_beside(pair)
        except InputError:
            count.refused.append(pair.name)
            return False
    (count.beside if found else count.silent).append(pair.name)
    if found and not any(limits_flight(each) for each in found):
        count.suspected.append(pair.name)
    return True if found else None


def attack(pairs: Sequence[Pair], kinds: Mapping[str, Corruption]) -> dict[str, Count]:
    """Apply every kind to every flight."""
    table = {}
    for kind, corrupt in kinds.items():
        table[kind] = Count()
        for pair in pairs:
            with np.errstate(all="ignore"):
                made = corrupt(pair)
            if made is not None:
                table[kind].add(pair.name, pair, made)
    return table


def other_aircraft(pairs: Sequence[Pair]) -> Count:
    """Every flight under the vehicle file and the database of another aircraft with mass properties
    of its own."""
    files = {p.vehicle.name: p for p in pairs if p.vehicle.mass.source == "constant"}
    count = Count()
    for pair in pairs:
        for name, other in files.items():
            if other.vehicle.reference != pair.vehicle.reference:
                made = replace(pair, vehicle=other.vehicle, database=other.database)
                count.add(f"{pair.name} as {name}", pair, made)
    return count


def report_right(pairs: Iterable[Pair]) -> None:
    """Print what is said of right flights, and what limits them beside databases of a tunnel."""
    flights, alarms, limited = 0, 0, []
    for pair in pairs:
        tunnels = scattered(pair, 0.2, flights)
        with np.errstate(all="ignore"):
            said = [*noticed(pair), *noticed_beside(pair)]
            beside = noticed_beside(tunnels)
        flights, alarms = flights + 1, alarms + len(said)
        limited += [tunnels.name] if any(limits_flight(each) for each in beside) else []
        for each in said:
            print(f"  FALSE ALARM {pair.name}: {each.sentence}", flush=True)
    print(
        f"right flights under other conditions: {flights}, false alarms: {alarms}; beside"
        f" databases of a tunnel limited {len(limited)}: {', '.join(limited)}"
    )


def main() -> None:
    """Print the table for the measured and the simulated flights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cache", type=Path, help="folder of JSBSim's flights")
    parts = ("flights", "files", "believable", "databases", "during", "lacking", "right")
    parser.add_argument("--only", choices=parts, help="one part of the table")
    parser.add_argument("--seed", type=int, default=0, help="of the simulated flights")
    parser.add_argument("--most", type=int, default=100, help="flights per kind of `during`")
    asked = parser.parse_args()
    cache = asked.cache or Path(tempfile.mkdtemp())
    cache.mkdir(parents=True, exist_ok=True)
    folder = Path(os.environ.get("AERODB_TEST_DATA", ROOT.parent / "shared" / "data"))
    drawn = simulated(seed=4 + asked.seed), fleet(cache, first=2 * asked.seed)
    pairs = [*measured(folder), *itertools.chain(*drawn)]
    alarms = 0
    for pair in pairs:
        with np.errstate(all="ignore"):
            for each in (*noticed(pair), *noticed_beside(pair)):
                alarms += 1
                print(f"  FALSE ALARM {pair.name}: {each.sentence}")
    print(f"right flights: {len(pairs)}, false alarms: {alarms}")
    if asked.only in (None, "right"):
        report_right(right_flights(cache))
    if asked.only in (None, "lacking"):
        count = Count()
        for pair in lacking(pairs):
            count.add(pair.name, pair, pair)
        stopped = [name for name in count.ingest + count.beside if name not in count.suspected]
        print(
            f"databases that lack an effect: {count.cases}, limited {len(stopped)}, only suspected"
            f" {len(count.suspected)}: {', '.join(stopped + count.suspected)}"
        )
    if asked.only in (None, "during"):
        rng = np.random.default_rng(1 + asked.seed)
        tables: list[During] = []
        for kind in {**SURFACES, **SENSORS}:
            mixed = [pairs[k] for k in rng.permutation(len(pairs))]
            counted = during(mixed, kind, asked.most)
            tables.append(counted)
            shown_numbers = f"{counted.cases:4} {counted.material:4} {len(counted.silent):4}"
            misnamed = f"; misnamed {', '.join(counted.misnamed)}" if counted.misnamed else ""
            print(f"  {kind:36} {shown_numbers}  {', '.join(counted.silent)}{misnamed}", flush=True)
        print(
            f"during a flight: {sum(e.cases for e in tables)},"
            f" material {sum(e.material for e in tables)},"
            f" of these silent {sum(len(e.silent) for e in tables)},"
            f" said {sum(e.said for e in tables)},"
            f" of these misnamed {sum(len(e.misnamed) for e in tables)}"
        )
    titles: dict[str, tuple[str, Mapping[str, Corruption]]] = {
        "flights": ("corrupted flights", FLIGHTS),
        "files": ("wrong vehicle files", FILES),
        "believable": ("believable values", BELIEVABLE),
    }
    titles["databases"] = ("wrong databases", DATABASES)
    for title, kinds in (titles[part] for part in titles if asked.only in (None, part)):
        table = attack_databases(pairs) if kinds is DATABASES else attack(pairs, kinds)
        if kinds is FILES:
            table["another aircraft's log"] = other_aircraft(pairs)
        print_table(title, table)


def print_table(title: str, table: Mapping[str, Count]) -> None:
    """Print a line per kind, and their sums."""
    print(f"{title}: at ingest, beside, refused, silent, material (only suspected, misnamed)")
    for kind, count in table.items():
        places = (count.ingest, count.beside, count.refused, count.silent, count.material)
        words = " ".join(f"{len(listed):4}" for listed in places)
        doubtful = f"({len(count.suspected):2}, {len(count.misnamed):2})"
        silent = ", ".join(
            f"{Path(name).stem}{' (material)' if name in count.material else ''}"
            for name in count.silent
        )
        wrong = f"; misnamed {', '.join(count.misnamed)}" if count.misnamed else ""
        print(f"  {kind:32} {words} {doubtful}  {silent}{wrong}")
    total, silent, material, misnamed = (
        sum(each)
        for each in zip(
            *((c.cases, len(c.silent), len(c.material), len(c.misnamed)) for c in table.values()),
            strict=True,
        )
    )
    said = sum(len(c.ingest) + len(c.beside) for c in table.values())
    print(
        f"{title}: silent {silent} of {total} ({100 * silent / total:.1f} %), material and silent"
        f" {material} ({100 * material / total:.1f} %); misnamed {misnamed} of {said}"
        f" ({100 * misnamed / max(said, 1):.1f} %)",
        flush=True,
    )


if __name__ == "__main__":
    main()
