"""Described manoeuvres: a trimmed start and test inputs on it, from a TOML file."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.nomenclature import CHANNELS
from aerodb.physics import (
    CORES,
    FORMS,
    DiscreteGust,
    Turbulence,
    VortexPair,
    gust_series,
    turbulence_at,
)
from aerodb.simulation.condition import Condition
from aerodb.simulation.inputs import SHAPES, Event
from aerodb.support import Array
from aerodb.units import quantity

_WAVES: Final = ("sweep", "multisine")
_EVENTS: Final = (*SHAPES, "hold")
_SHAPES: Final = (*_EVENTS, "step", *_WAVES)
_TRIM: Final = {
    "V": "m/s", "altitude": "m", "climb": "rad", "bank": "rad", "beta": "rad",
    "turn_rate": "rad/s",
}  # fmt: skip
#: Longest manoeuvre [s].
_LONGEST: Final = 3600.0


@dataclass(frozen=True)
class Wave:
    """A frequency sweep or a multisine on one input.

    Parameters
    ----------
    target : input of the database.
    start, duration : [s].
    amplitude : of the sweep; root sum square of the multisine's components; unit of the target.
    low, high : frequencies [Hz].
    shape : ``sweep``, a sine whose frequency grows exponentially (Tischler & Remple, Aircraft and
        Rotorcraft System Identification (2012), section 5.11), or ``multisine``, all harmonics of
        1/duration in the band with Schroeder's phases (Morelli, AIAA 2003-5466).
    """

    target: str
    start: float
    duration: float
    amplitude: float
    low: float
    high: float
    shape: str

    def __call__(self, time: Array) -> Array:
        """Return the value at `time` [s], an array of any shape."""
        since = np.clip(time - self.start, 0.0, self.duration)
        inside = (time >= self.start) & (time <= self.start + self.duration)
        if self.shape == "sweep":
            rate = np.log(self.high / self.low) / self.duration
            phase = 2.0 * np.pi * self.low * np.expm1(rate * since) / rate
            return np.asarray(np.where(inside, self.amplitude * np.sin(phase), 0.0))
        harmonics = np.arange(
            int(np.ceil(self.low * self.duration - 1e-9)),
            int(np.floor(self.high * self.duration + 1e-9)) + 1,
        )
        number = np.arange(1, len(harmonics) + 1)
        phases = -np.pi * number * (number - 1) / max(len(harmonics), 1)
        angles = 2.0 * np.pi * harmonics / self.duration
        value = sum(np.cos(w * since + p) for w, p in zip(angles, phases, strict=True))
        scale = self.amplitude / np.sqrt(max(len(harmonics), 1))
        return np.asarray(np.where(inside, scale * value, 0.0))


@dataclass(frozen=True)
class Manoeuvre:
    """Test inputs from a trimmed start.

    condition : of the trim; `glides`: without thrust, the path angle is found. duration : [s].
    given : inputs and mass properties held, name -> text with unit. inputs : what is added to the
    trimmed inputs. thrust : input that holds the airspeed of the trim; empty: the vehicle's thrust.
    turbulence : with the `seed` of its draw; gusts : 1-cosine. wake : of another aircraft, its
    place from the start of the flight.
    """

    name: str
    condition: Condition
    glides: bool
    duration: float
    given: Mapping[str, str]
    inputs: tuple[Event | Wave, ...]
    thrust: str = ""
    turbulence: Turbulence | None = None
    seed: int = 0
    gusts: tuple[DiscreteGust, ...] = ()
    wake: VortexPair | None = None

    def air(self, time: Array, span: float) -> dict[str, Array]:
        """Return the moving air at `time` [s]: (n,) of each component of velocity [m/s] and
        rotation [rad/s] that is not zero, at the airspeed of the trim. span : [m]."""
        speed = self.condition.V
        moving = [each.series(time, speed, span) for each in self.gusts]
        if self.turbulence is not None:
            moving.append(gust_series(self.turbulence, time, speed, span, self.seed))
        found: dict[str, Array] = {}
        for each in moving:
            for name, values in each.items():
                found[name] = found.get(name, np.zeros_like(time)) + values
        return found

    def series(self, time: Array) -> dict[str, Array]:
        """Return what is added to each input, (n,) at `time` [s]."""
        moved: dict[str, Array] = {}
        for each in self.inputs:
            moved[each.target] = moved.get(each.target, np.zeros_like(time)) + each(time)
        return moved


def parse_manoeuvre(text: str, where: str = "manoeuvre") -> Manoeuvre:
    """Return a manoeuvre from TOML; docs/method/simulation.md shows the form.

    Raises InputError naming the entry that is wrong. Quantities become SI units: [m/s], [m], [rad],
    [s].
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is no TOML: {error}", where) from None
    _known(
        document, ("name", "duration", "trim", "set", "input", "turbulence", "gust", "wake"), where
    )
    stated = document.get("trim")
    if not isinstance(stated, Mapping) or not {"V", "altitude"} <= set(stated):
        raise InputError("has no [trim] with V and altitude", where, 'V = "60 m/s"')
    others = ("load_factor", "pull_up", "hover", "ground", "glide", "thrust")
    _known(stated, (*_TRIM, *others), f"{where}, [trim]")
    values: dict[str, Any] = {
        name: quantity(stated[name], unit) for name, unit in _TRIM.items() if name in stated
    }
    values |= {name: stated[name] for name in ("load_factor", "pull_up") if name in stated}
    values["ground"] = bool(stated.get("ground", False))
    values["hover"] = bool(stated.get("hover", values["V"] == 0.0 and not values["ground"]))
    glides = bool(stated.get("glide", False))
    condition = Condition(**({"climb": None} if glides else {}) | values)
    duration = quantity(document.get("duration", 20.0), "s")
    if not 0.0 < duration <= _LONGEST:
        raise InputError(f"lasts {duration:g} s", where, f"up to {_LONGEST:g} s")
    inputs = tuple(
        _input(entry, f"{where}, input {number}", duration)
        for number, entry in enumerate(document.get("input", ()), 1)
    )
    given = {name: str(value) for name, value in document.get("set", {}).items()}
    name = str(document.get("name", where))
    thrust = str(stated.get("thrust", ""))
    if glides and thrust:
        raise InputError("glide and thrust together", f"{where}, [trim]", "leave one of them out")
    air, seed = _turbulence(document.get("turbulence"), condition, f"{where}, [turbulence]")
    gusts = tuple(
        _gust(entry, f"{where}, gust {number}")
        for number, entry in enumerate(document.get("gust", ()), 1)
    )
    wake = _wake(document.get("wake"), condition, f"{where}, [wake]")
    if (air or gusts or wake) and (condition.ground or not condition.V > 0.0):
        raise InputError(
            "moving air needs a start in flight with airspeed", where, "leave it out, or give V"
        )
    return Manoeuvre(
        name, condition, glides, duration, given, inputs, thrust, air, seed, gusts, wake
    )


def _wake(entry: Any, condition: Condition, where: str) -> VortexPair | None:
    """A vortex pair, by a point of its axis: north of the start, east of it and below it."""
    if entry is None:
        return None
    if not isinstance(entry, Mapping):
        raise InputError("is no table", where, 'circulation = "200 m^2/s"')
    units = {
        "circulation": "m^2/s", "core_radius": "m", "spacing": "m", "ahead": "m", "right": "m",
        "below": "m", "heading": "rad", "slope": "rad",
    }  # fmt: skip
    _known(entry, (*units, "core"), where)
    for name in ("circulation", "core_radius", "spacing", "ahead"):
        if name not in entry:
            raise InputError(f"has no {name}", where, f"add {name}")
    values = {name: quantity(entry.get(name, 0.0), unit) for name, unit in units.items()}
    core = entry.get("core", CORES[-1])
    if core not in CORES:
        raise InputError(f"unknown core '{core}'", where, nearest(str(core), CORES))
    if min(values[name] for name in ("circulation", "core_radius", "spacing")) <= 0.0:
        raise InputError("circulation, core_radius or spacing is not positive", where)
    ahead, right, below = (values.pop(name) for name in ("ahead", "right", "below"))
    return VortexPair(**values, place=(ahead, right, condition.altitude - below), core=core)


def _turbulence(entry: Any, condition: Condition, where: str) -> tuple[Turbulence | None, int]:
    """Turbulence as stated, or by the wind 6 m above ground where the altitude is the height."""
    if entry is None:
        return None, 0
    if not isinstance(entry, Mapping):
        raise InputError("is no table", where, 'intensity = "1 m/s"')
    _known(entry, ("form", "intensity", "scale", "wind_at_6m", "seed"), where)
    form = entry.get("form", FORMS[0])
    if form not in FORMS:
        raise InputError(f"unknown form '{form}'", where, nearest(str(form), FORMS))
    seed = entry.get("seed", 0)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise InputError(f"seed is {seed!r}", where, "a whole number from 0")
    if ("intensity" in entry) == ("wind_at_6m" in entry):
        raise InputError("needs either intensity or wind_at_6m", where, 'intensity = "1 m/s"')
    wind = quantity(entry.get("wind_at_6m", 1.0), "m/s")
    air = turbulence_at(form, condition.altitude, wind)
    lengths = _three(entry["scale"], "m", f"{where}, scale") if "scale" in entry else air.lengths
    sigma = air.intensities
    if "intensity" in entry:
        sigma = _three(entry["intensity"], "m/s", f"{where}, intensity")
    if min(lengths) <= 0.0 or min(sigma) < 0.0 or wind < 0.0:
        raise InputError("intensity or scale is not positive", where, 'scale = "533 m"')
    return Turbulence(form, lengths, sigma), seed


def _three(value: Any, unit: str, where: str) -> tuple[float, float, float]:
    """One value for u, v and w, or one of each."""
    values = value if isinstance(value, list) else [value] * 3
    if len(values) != 3:
        raise InputError(f"{len(values)} values", where, "one, or those of u, v and w")
    u, v, w = (quantity(each, unit) for each in values)
    return u, v, w


def _gust(entry: Mapping[str, Any], where: str) -> DiscreteGust:
    _known(entry, ("component", "amplitude", "gradient", "start"), where)
    for name in ("component", "amplitude", "gradient"):
        if name not in entry:
            raise InputError(f"has no {name}", where, f"add {name}")
    component = str(entry["component"])
    if component not in ("u", "v", "w"):
        raise InputError(f"unknown component '{component}'", where, "u, v or w")
    amplitude, gradient, start = (
        quantity(entry.get(name, 1.0), unit)
        for name, unit in (("amplitude", "m/s"), ("gradient", "m"), ("start", "s"))
    )
    if not gradient > 0.0:
        raise InputError(f"gradient is {gradient:g} m", where, 'gradient = "30 m"')
    return DiscreteGust(f"gust_{component}", amplitude, gradient, start)


def _input(entry: Mapping[str, Any], where: str, duration: float) -> Event | Wave:
    _known(entry, ("target", "shape", "start", "width", "amplitude", "duration", "band"), where)
    shape, target = str(entry.get("shape", "doublet")), str(entry.get("target", ""))
    if shape not in _SHAPES:
        raise InputError(f"unknown shape '{shape}'", where, nearest(shape, _SHAPES))
    for name in ("target", "amplitude", *(("band",) if shape in _WAVES else ())):
        if name not in entry:
            raise InputError(f"has no {name}", where, f"add {name}")
    unit = CHANNELS[target].unit if target in CHANNELS else "1"
    amplitude = quantity(entry["amplitude"], unit)
    start = quantity(entry.get("start", 1.0), "s")
    if shape in _WAVES:
        low, high = (quantity(value, "Hz") for value in entry["band"])
        lasts = quantity(entry.get("duration", duration - start), "s")
        if not (0.0 < low < high and lasts > 0.0):
            raise InputError(
                f"band {low:g} to {high:g} Hz over {lasts:g} s", where, "0 < low < high"
            )
        return Wave(target, start, lasts, amplitude, low, high, shape)
    if shape == "step":
        return Event(target, start, max(duration, 1.0), amplitude, "pulse")
    width = quantity(entry.get("width", 1.0), "s")
    if not width > 0.0:
        raise InputError(f"width is {width:g} s", where, 'width = "1 s"')
    return Event(target, start, width, amplitude, shape)


def _known(entry: Mapping[str, Any], names: tuple[str, ...], where: str) -> None:
    for name in entry:
        if name not in names:
            raise InputError(f"unknown key '{name}'", where, nearest(name, names))
