"""Logs, vehicles and databases from files, without a workspace."""

import tempfile
from collections import Counter
from collections.abc import Mapping as Dictionary
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from aerodb.conditioning import Conditioning, without_wild_points
from aerodb.consistency import Calibration
from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.flight import Flight
from aerodb.flows.library.views import (
    Data,
    Result,
    Summary,
    channel_values,
    shown_unit,
    span,
    time_coordinate,
)
from aerodb.logs import (
    Mapping,
    choose_mapping,
    consequences_of_missing,
    mapped_clock_suspicions,
    usable_flight,
)
from aerodb.nomenclature import channel
from aerodb.recording import Recording
from aerodb.storage.files import read_recording
from aerodb.storage.limits import Limits
from aerodb.storage.mappings import builtin_mappings, load_mapping
from aerodb.support import counted
from aerodb.suspicions import examine
from aerodb.tables import AeroDatabase
from aerodb.tasks.workers import parsed_log
from aerodb.vehicle import Vehicle, parse_vehicle

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class Log(Result):
    """A log as a flight: what was logged, and what of it is used.

    recording : topics as logged. flight : canonical channels (SI, body axes) on one time grid.
    conditioning : likely faults, segments and delays. calibration : of its sensors, where a
    workspace has one.
    """

    name: str
    recording: Recording
    flight: Flight
    vehicle: Vehicle
    conditioning: Conditioning
    calibration: Calibration | None = None

    def topic(self, name: str) -> "pd.DataFrame":
        """Return a topic as logged, in the log's own units and on its own clock [s].

        Raises UnknownNameError for a topic that the log does not have.
        """
        import pandas as pd  # slow to import

        topics = self.recording.topics
        if name not in topics:
            raise UnknownNameError(f"no topic '{name}'", self.name, nearest(name, topics))
        index = pd.Index(topics[name].time, name="time")
        frame = pd.DataFrame(dict(topics[name].fields), index=index)
        frame.attrs["units"] = dict(topics[name].units)
        return frame

    def summary(self) -> Summary:
        """Return format, mapping, duration [s] and segments of the log, and least and greatest
        value of each channel (n,) in SI units."""
        flight = self.flight
        start = "" if flight.start_utc is None else f", {flight.start_utc:%Y-%m-%d %H:%M} UTC"
        kinds = Counter(each.kind for each in self.conditioning.segments)
        facts = [
            ("vehicle", self.vehicle.name),
            ("recorded", f"{self.recording.format}, {_topics(self.recording)}{start}"),
            ("mapping", flight.mapping),
            ("duration", f"{flight.duration:.1f} s at {1.0 / flight.step:.4g} Hz"),
            ("segments", ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "none"),
        ]
        said = [*flight.notes, *(each.what for each in flight.damage)]
        said += [each.sentence for each in self.conditioning.suspicions]
        said += consequences_of_missing(flight.missing)
        rows = [
            (name, shown_unit(channel(name).unit), *span(values))
            for name, values in flight.channels.items()
        ]
        header = ("channel", "unit", "least", "greatest")
        return Summary(f"log {self.name}", facts, header, rows, said)

    def data(self) -> Data:
        """Return its canonical channels, (n,) over time [s], in SI units."""
        return Data(
            "time",
            {"time": time_coordinate(self.flight.time)},
            channel_values(self.flight.channels),
            {"flight": self.flight.id, "vehicle": self.vehicle.name},
        )


def _topics(recording: Recording) -> str:
    return counted(len(recording.topics), "topic")


def load(
    path: str | Path,
    vehicle: str | Path | Vehicle,
    mapping: str | Path | Mapping | None = None,
    limits: Limits | None = None,
) -> Log:
    """Read a log of any known format as a flight of a vehicle.

    The log is parsed in another process under resource limits, as the commands do: a log is not
    trusted.

    Parameters
    ----------
    path : ULog, DataFlash, MCAP, MAT, Parquet, CSV or text.
    vehicle : a vehicle file (TOML), or what `load_vehicle` returned.
    mapping : which field is which channel: a built-in name such as ``px4``, a mapping file, or
        None for the built-in one that fits.
    limits : of size, memory and time; None for the default ones.

    Raises InputError for a log that is damaged beyond use, that no mapping fits, or that gives no
    coefficient.
    """
    described = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
    chosen = load_mapping(mapping) if isinstance(mapping, (str, Path)) else mapping
    place = Path(path)
    if not place.is_file():
        raise InputError("no such file", str(place), "check its name")
    with (
        tempfile.TemporaryDirectory(prefix="aerodb-") as folder,
        parsed_log(place, Path(folder) / "topics", limits or Limits()) as parsed,
    ):
        recording = read_recording(parsed.folder)
    return log_of(recording, described, chosen, place.name)


def log_of(
    recording: Recording,
    vehicle: Vehicle,
    mapping: Mapping | None = None,
    name: str = "",
    calibration: Calibration | None = None,
) -> Log:
    """Return a recording in memory as a flight of a vehicle; None: the built-in mapping that fits.

    Raises InputError as `load`.
    """
    layout = mapping or choose_mapping(recording, builtin_mappings().values())
    flight = usable_flight(recording, layout, vehicle, flight_id=recording.sha256)
    found = examine(flight, mapped_clock_suspicions(recording, layout), vehicle)
    used = without_wild_points(flight)
    return Log(name or recording.source, recording, used, vehicle, found, calibration)


def load_vehicle(path: str | Path) -> Vehicle:
    """Return the vehicle of a vehicle file (TOML): geometry, masses, surfaces, sensors.

    Raises InputError with the key and the reason. Schema: docs/reference/conventions.md, section
    "Vehicle file"; quantities become SI units.
    """
    return parse_vehicle(read_text(path), str(path))


def load_database(path: str | Path, bindings: Dictionary[str, str] | None = None) -> AeroDatabase:
    """Return the aerodynamic database of a file: native TOML, DAVE-ML, JSBSim, CSV, MAT, NetCDF.

    Parameters
    ----------
    bindings : input of the file -> canonical channel, for those whose names do not say.

    Tables become SI units. Raises InputError for a file that cannot be read, or has inputs that
    nothing is bound to.
    """
    from aerodb.storage.files import files_beside
    from aerodb.tasks.steps import read_database  # importers of all formats take time to import

    file = Path(path)
    return read_database(_bytes(file), file.name, bindings or {}, files_beside(file))


def read_text(path: str | Path) -> str:
    """Return the text (UTF-8, RFC 3629) of a file; InputError where it cannot be read."""
    try:
        return _bytes(Path(path)).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError("not UTF-8 text", str(path), "save it as UTF-8") from error


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        what = f"the file cannot be read: {error.strerror or error}"
        raise InputError(what, str(path), "check its name and permissions") from error
