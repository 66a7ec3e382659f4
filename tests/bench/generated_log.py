"""A long log that flies, for benchmarks: the small glider of docs/guides/with-a-boom.md in light
turbulence, logged with the topics of a fixed-wing PX4 flight.

The product's own simulator flies it, and its instruments add noise, biases and delays: the channels
agree with one motion, as those of a real log do. Topics that no path is made of fill the file to the
size that an hour of a real log has.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from aerodb.exchange.native import read_native
from aerodb.recording import Topic
from aerodb.simulation.sensors import measure
from aerodb.storage.writers.ulog import write_ulog
from aerodb.vehicle import parse_vehicle
from tests.support.guide_flights import SECONDS, Flown, blocks, fly_glider, instruments, steeper

_GUIDE = Path(__file__).resolve().parents[2] / "docs" / "guides" / "with-a-boom.md"
_FILES = {title: text for _, title, text in blocks(_GUIDE.read_text(encoding="utf-8")) if title}
#: At the rate of the inertial topics: the guide asks for 25 Hz.
VEHICLE = _FILES["my-glider.toml"].replace("rate = 25.0\n", "")
NAME = "my-glider"
DATABASE = _FILES["handbook.toml"]

#: Rates of the topics [Hz]; all others are logged at 100 Hz.
_SLOWER = {"vehicle_air_data": 50.0, "vehicle_local_position": 50.0}
#: Height at the start, enough for an hour of gliding [m], and the wind of the turbulence [m/s].
_HEIGHT, _WIND_AT_6M = 8500.0, 1.0
_FILLERS = 32


def write_log(path: Path, duration: float) -> None:
    """Writes the first `duration` [s] of the flight as a ULog file. The flight is flown once per
    process, where the longest log is written first."""
    write_ulog(path, generated_topics(duration), metadata={"sys_name": "PX4"})


def generated_topics(duration: float, seed: int = 0) -> Iterator[Topic]:
    """40 topics over `duration` [s]: eight that a PX4 flight is made of, and fillers; about 140 kB
    per second, in an hour about 500 MB in 6.8 million messages."""
    generator = np.random.default_rng(seed)
    flown = _flown(duration)
    carried = tuple(
        replace(instrument, rate=_SLOWER.get(instrument.topic, 100.0))
        for instrument in instruments(parse_vehicle(VEHICLE), boom=True)
    )
    for topic in measure(flown.history, flown.channels, 0, carried, generator):
        kept = topic.time <= duration
        yield Topic(
            topic.name,
            topic.time[kept],
            {name: values[kept] for name, values in topic.fields.items()},
        )
    for number in range(_FILLERS):
        rate = 100.0 if number < 9 else 10.0
        time = np.arange(1, int(duration * rate) + 1) / rate
        wave = np.float32(0.05) * np.sin(0.3 * time).astype(np.float32)
        noise = np.float32(0.002) * generator.standard_normal(len(time), dtype=np.float32)
        fields = {f"value[{k}]": wave + np.roll(noise, 7 * k) for k in range(24)}
        yield Topic(f"filler_{number}", time, fields)


_LONGEST: list[Flown] = []


def _flown(duration: float) -> Flown:
    """A flight of at least `duration` [s]: the one flown before, where it was long enough."""
    if not _LONGEST or _LONGEST[0].history.time[-1] < duration:
        _LONGEST[:] = [_fly(int(np.ceil(duration / (2 * SECONDS))))]
    return _LONGEST[0]


def _fly(cycles: int) -> Flown:
    handbook = read_native(DATABASE)
    return fly_glider(
        parse_vehicle(VEHICLE),
        handbook,
        read_native(steeper(DATABASE)),
        1,
        7,
        cycles=cycles,
        height=_HEIGHT,
        wind_at_6m=_WIND_AT_6M,
    )
