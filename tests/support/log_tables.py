"""Text tables of one flight as tools write them, and the judgement of the mappings drafted for
them: each channel is right, asked, or wrong in silence."""

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerodb.logs import draft_mapping
from aerodb.nomenclature import channel
from aerodb.storage.readers.tabular import read_tabular
from aerodb.units import conversion

#: Channel and the unit in which a column holds it, with -1 for the other sign; None: another thing.
Meaning = tuple[str, str, float] | None


@dataclass(frozen=True)
class Tool:
    """A layout: columns with their meanings, and how the file is written.

    head : lines above the data. clock : seconds to a text, or to a number, for columns of the
    meaning ``time``. comma : decimal commas. whole : positions in whole numbers of 1e-7 deg.
    """

    columns: tuple[tuple[str, Meaning], ...]
    head: Callable[[list[str]], str]
    clock: Callable[[float, int], str]
    sep: str = ","
    end: str = ""
    comma: bool = False
    whole: bool = False


def motion(seed: int, rate: float) -> dict[str, np.ndarray]:
    """A flight of a light aircraft in SI, with what loggers have beside it."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(20 * rate)) / rate
    slow, fast = 2 * np.pi * rng.uniform(0.03, 0.1), 2 * np.pi * rng.uniform(0.2, 0.5)
    phi = np.deg2rad(25.0) * np.sin(slow * t)
    theta = np.deg2rad(4.0 + 3.0 * np.sin(fast * t))
    speed = rng.uniform(25.0, 90.0) + 3.0 * np.sin(fast * t)
    truth = {
        "time": t,
        "V": speed,
        "calibrated_airspeed": 0.93 * speed,
        "alpha": np.deg2rad(4.0 + 2.0 * np.sin(fast * t)),
        "beta": np.deg2rad(2.0 * np.cos(fast * t)),
        "phi": phi,
        "theta": theta,
        "psi": np.deg2rad(40.0 + 60.0 * np.sin(slow * t)),
        "p": np.gradient(phi, t),
        "q": np.gradient(theta, t),
        "r": np.deg2rad(6.0) * np.cos(slow * t),
        "ax_imu": 0.5 * np.sin(fast * t),
        "ay_imu": 0.4 * np.cos(slow * t),
        "az_imu": -9.81 - 2.0 * np.sin(fast * t),
        "altitude": 600.0 + 100.0 * np.sin(slow * t) + t,
        "pressure_altitude": 655.0 + 101.0 * np.sin(slow * t) + t,
        "height_above_ground": 300.0 + 100.0 * np.sin(slow * t) + t,
        "velocity_down": -1.0 - 100.0 * slow * np.cos(slow * t),
        "velocity_north": speed * np.cos(slow * t),
        "velocity_east": speed * np.sin(slow * t),
        "latitude": np.deg2rad(47.1 + 1e-5 * t),
        "longitude": np.deg2rad(8.5 + 1.3e-5 * t),
        "temperature": 281.0 - 0.01 * t,
        "static_pressure": 94000.0 - 10.0 * t,
        "qbar": 0.6 * speed**2,
        "rho": 1.15 - 1e-4 * t,
        "mach": speed / 336.0,
        "delta_elevator": np.deg2rad(5.0) * np.sin(fast * t),
        "delta_aileron": np.deg2rad(8.0) * np.sin(slow * t),
        "delta_rudder": np.deg2rad(3.0) * np.cos(slow * t),
    }
    truth["noise"] = rng.normal(50.0, 5.0, t.size)
    truth["count"] = np.arange(t.size, dtype=float)
    return truth


def c(name: str, unit: str, sign: float = 1.0) -> Meaning:
    return (name, unit, sign)


def stamp(seconds: float, sign: str = ".") -> str:
    return f"14:{int(seconds) // 60:02d}:{int(seconds + 1e-9) % 60:02d}" + (
        f"{sign}{round(seconds % 1 * 1000) % 1000:03d}"
    )


def number(seconds: float, row: int) -> str:
    return f"{seconds:.5f}"


def plain(names: list[str], sep: str = ",") -> str:
    return sep.join(names) + "\n"


def units_below(units: str, sep: str = ",") -> Callable[[list[str]], str]:
    return lambda names: plain(names, sep) + units.replace(",", sep) + "\n"


T: Meaning = ("time", "s", 1.0)


def write(path: Path, tool: Tool, truth: dict[str, np.ndarray], seed: int) -> None:
    """A table of a tool; columns that are no channel hold noise, counters count."""
    rng = np.random.default_rng(seed)
    texts = []
    for number_, (name, meaning) in enumerate(tool.columns):
        if meaning == T:
            cells = [tool.clock(float(t), number_) for t in truth["time"]]
        elif meaning is None:
            counts = name in ("loopIteration", "seq")
            values = truth["count"] if counts else rng.normal(50.0, 9.0, truth["time"].size)
            cells = [f"{value:.0f}" if counts else f"{value:.4f}" for value in values]
        else:
            known, unit, sign = meaning
            scale, offset = conversion(unit, channel(known).unit)
            values = (sign * truth[known] - offset) / scale
            whole = tool.whole and name in ("lat", "lon")
            cells = [f"{value * 1e7:.0f}" if whole else f"{value:.7f}" for value in values]
        texts.append([re.sub(r"\.(?=\d+$)", ",", cell) if tool.comma else cell for cell in cells])
    names = [name for name, _ in tool.columns]
    lines = [tool.sep.join(row) + tool.end + "\n" for row in zip(*texts, strict=True)]
    path.write_text(tool.head(names) + "".join(lines), encoding="utf-8")


def judged(path: Path, tool: Tool, truth: dict[str, np.ndarray]) -> Counter[str]:
    """How many channels are right, asked, left unnamed, and wrong in silence."""
    recording = read_tabular(path)
    draft = draft_mapping(recording, "own")
    fields = recording.topics["table"].fields
    found: Counter[str] = Counter()
    wrong = []
    clock = draft.clock
    assert clock is not None, path.read_text()[:300]
    time = np.asarray(fields[clock.field]) * conversion(clock.unit, "s")[0]
    is_right = np.allclose(time - time[0], truth["time"], atol=2e-3)
    found["right" if is_right else "asked" if clock.open else "wrong"] += 1
    if not is_right and not clock.open:
        wrong.append(f"time: {clock}")
    meant = dict(zip(fields, (meaning for _, meaning in tool.columns), strict=False))
    for guess in draft.guesses:
        scale, offset = conversion(guess.unit, channel(guess.channel).unit)
        values = scale * guess.scale * np.asarray(fields[guess.field]) + offset
        spread = np.ptp(truth[guess.channel]) if guess.channel in truth else 1.0
        meaning = meant[guess.field]
        is_right = (
            meaning is not None
            and meaning[0] == guess.channel
            and bool(np.allclose(values, truth[guess.channel], atol=0.01 * spread + 1e-4))
        )
        kind = "right" if is_right else "asked" if guess.confidence == "asked" else "wrong"
        found[kind] += 1
        if kind == "wrong":
            wrong.append(f"{guess}")
    mapped = {guess.field for guess in draft.guesses}
    lost = [f for f, m in meant.items() if m not in (None, T) and f not in mapped]
    found["listed as not mapped"] += len(lost)
    assert all(f"# table.{field}: " in draft.text for field in lost)
    assert not wrong, wrong
    return found
