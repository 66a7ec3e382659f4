"""Draft of a mapping file from any log: guesses by name, unit, range and derivative relations, each
with its reason, and the questions that only the owner of the log can answer."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.logs.mapping_file import Mapping as LogMapping
from aerodb.logs.mapping_file import matching_topics
from aerodb.nomenclature import CHANNELS, channel, is_surface
from aerodb.recording import Recording, Topic
from aerodb.support import Array
from aerodb.units import conversion

#: Channel -> pattern of its names in logs, in lower case with underscores.
_NAMES: Final[dict[str, str]] = {
    "V": r"(true_?)?(air_?speed|tas|v_?tas|vtas|v_true)|v",
    "calibrated_airspeed": r"cas|ias|(calibrated|indicated)_?air_?speed|vcas|vias",
    "alpha": r"alpha|aoa|alfa|angle_?of_?attack|alpha_?vane",
    "beta": r"beta|aos|ssa|(angle_?of_?)?side_?slip(_?angle)?|beta_?vane",
    "qbar": r"qbar|q_?dyn|dynamic_?pressure|q_?inf|pdyn",
    "mach": r"mach(_?number)?|ma",
    "rho": r"rho|(air_?)?density",
    "temperature": r"oat|sat|static_?(air_?)?temp(erature)?|temperature",
    "static_pressure": r"ps|p_?stat(ic)?|static_?pressure",
    "p": r"p|(b_?)?roll_?rate|gyro_?x|gx|omega_?x|wx",
    "q": r"q|(b_?)?pitch_?rate|gyro_?y|gy|omega_?y|wy",
    "r": r"r|(b_?)?yaw_?rate|gyro_?z|gz|omega_?z|wz",
    "ax_imu": r"ax|a_?x|nx|acc(el)?_?x|(b_?)?long_?acc(el)?",
    "ay_imu": r"ay|a_?y|ny|acc(el)?_?y|(b_?)?lat_?acc(el)?",
    "az_imu": r"az|a_?z|nz|acc(el)?_?z|(b_?)?norm(al)?_?acc(el)?",
    "phi": r"phi|roll|bank(_?angle)?|roll_?angle|euler_?roll",
    "theta": r"theta|pitch|pitch_?(angle|attitude)|euler_?pitch",
    "psi": r"psi|yaw|heading|true_?heading|yaw_?angle|euler_?yaw",
    "altitude": r"alt(itude)?(_?msl)?|h_?msl|h_?baro|baro_?alt(itude)?",
    "height_above_ground": r"agl|h_?agl|height_?above_?ground|radio_?alt(itude)?",
    "velocity_north": r"v_?n(orth)?|vel_?n(orth)?|velocity_?north|north_?velocity",
    "velocity_east": r"v_?e(ast)?|vel_?e(ast)?|velocity_?east|east_?velocity",
    "velocity_down": r"v_?d(own)?|vel_?d(own)?|velocity_?down|down_?velocity",
    "latitude": r"lat(itude)?|gps_?lat",
    "longitude": r"lon(g|gitude)?|gps_?lon(g)?",
    "delta_elevator": r"(delta_?)?(elevator|elev|ele)(_?(pos|position|deflection))?|de|delta_?e",
    "delta_aileron": r"(delta_?)?(aileron|ail)(_?(pos|position|deflection))?|da|delta_?a",
    "delta_rudder": r"(delta_?)?(rudder|rud)(_?(pos|position|deflection))?|dr|delta_?r",
    "delta_flap": r"(delta_?)?flaps?(_?(pos|position|deflection))?|df|delta_?f",
    "thrust": r"thrust|total_?thrust",
    "mass": r"mass|aircraft_?mass",
}
_TIME: Final = re.compile(r"t|time|times|timestamp|time_?(s|sec|ms|us)|t_?(s|sec|ms|us)|utc_?sec")
#: Ending of a name, or text in brackets behind it -> unit.
_UNIT_WORDS: Final = {
    **{u: u for u in ("deg", "rad", "m", "ft", "kg", "Pa", "hPa", "K", "degC", "N", "g", "lbf")},
    **{"dps": "deg/s", "degs": "deg/s", "deg_s": "deg/s", "deg/s": "deg/s", "rad_s": "rad/s"},
    **{"rads": "rad/s", "rad/s": "rad/s", "mps": "m/s", "m_s": "m/s", "m/s": "m/s", "kn": "knot"},
    **{"kts": "knot", "kt": "knot", "knots": "knot", "fps": "ft/s", "ft/s": "ft/s", "kmh": "km/h"},
    **{"mps2": "m/s^2", "m_s2": "m/s^2", "m/s^2": "m/s^2", "m/s2": "m/s^2", "psf": "psf"},
    **{"lb": "lb", "slug": "slug", "feet": "ft", "meter": "m", "m_s_s": "m/s^2", "hpa": "hPa"},
    **{"pa": "Pa", "k": "K", "degc": "degC", "n": "N", "s": "s", "ms": "ms", "us": "us"},
}
_RATES: Final = (("phi", "p"), ("theta", "q"), ("psi", "r"))
_LEAST_CORRELATION: Final = 0.9
#: Tables of fewer rows than this share of the longest are not along the flight.
_LEAST_SHARE: Final = 0.1
#: Speed of sound at -60 degC, with what instruments are off [m/s].
_SLOWEST_SOUND = 285.0
#: Speed of sound at 50 degC, with what instruments are off [m/s].
_FASTEST_SOUND = 365.0


@dataclass(frozen=True)
class Guess:
    """A channel, the field that may be it, and why.

    unit : '' where it stays open. assumed : whether nothing but its size speaks for it.
    """

    channel: str
    topic: str
    field: str
    unit: str
    scale: float
    reason: str
    assumed: bool = False


@dataclass(frozen=True)
class MappingDraft:
    """Text of a mapping file, its guesses, and the questions that stay open."""

    text: str
    guesses: tuple[Guess, ...]
    questions: tuple[str, ...]


def draft_mapping(
    recording: Recording, name: str, built_in: LogMapping | None = None
) -> MappingDraft:
    """Return a commented mapping for a log.

    built_in : a mapping that fits the log; what it finds is taken from it.

    Units come from the log, from the names of fields, or from the range of the values; where none
    of them decides, SI is written and a question is asked. Empty columns, and those that are zero
    throughout, are never mapped.

    Columns (n,) in the units of the log.
    """
    columns = {
        (topic.name, field): values
        for topic in recording.topics.values()
        for field, values in numeric_columns(topic)
    }
    guesses: dict[str, Guess] = {}
    questions: list[str] = []
    clocks = clock_columns(recording, columns) if recording.format == "tabular" else {}
    times = set(clocks.values())
    usable = {
        key: values
        for key, values in columns.items()
        if np.any(np.isfinite(values)) and np.any(values) and key not in times
    }
    for guess in _known(recording, built_in) if built_in else ():
        if (guess.topic, guess.field) in usable:
            guesses.setdefault(guess.channel, guess)
    is_known = bool(guesses)  # the built-in mapping knows better than names
    most = max((len(topic.time) for topic in recording.topics.values()), default=0)
    for (topic, field), values in usable.items():
        if is_known or (values.size < _LEAST_SHARE * most and recording.format == "tabular"):
            continue
        named = guess_by_name(recording.topics[topic], field, values)
        if named is not None:
            guesses.setdefault(named.channel, named)
    guesses = {known: _settled(guess, guesses, usable) for known, guess in guesses.items()}
    for guess in guesses.values():
        if guess.assumed:
            questions.append(f"is {guess.field} ({guess.channel}) in {guess.unit}? {guess.reason}")
    if not is_known:
        questions += _relations(recording, guesses, clocks, usable)
    empty = [f"{t}.{f}" for (t, f) in columns if (t, f) not in usable and (t, f) not in times]
    if empty:
        questions.append(
            f"not mapped, as empty or zero throughout: {', '.join(sorted(empty)[:20])}"
        )
    if recording.format == "tabular" and not clocks:
        questions.append("no column runs as a time does: add a [time] section")
    left = [key for key in usable if key not in {(g.topic, g.field) for g in guesses.values()}]
    head = _clock_lines(clocks, columns, built_in if is_known else None)
    tail = _derived_lines(built_in) if built_in and is_known else []
    text = _text(recording, name, head, tail, columns, guesses, questions, left)
    return MappingDraft(text, tuple(guesses.values()), tuple(questions))


def _known(recording: Recording, built_in: LogMapping) -> Iterator[Guess]:
    """Return what a built-in mapping finds."""
    for entry in built_in.channel:
        for source in entry.sources:
            for topic in matching_topics(source.topic, recording.topics):
                if source.field in recording.topics[topic].fields and source.unit is not None:
                    why = f"built-in mapping {built_in.name}"
                    yield Guess(entry.name, topic, source.field, source.unit, source.scale, why)


def _settled(
    guess: Guess, guesses: Mapping[str, Guess], columns: Mapping[tuple[str, str], Array]
) -> Guess:
    """A guess whose unit another channel decides: the airspeed by the Mach number, the longitude by
    the latitude."""
    other = guesses.get({"V": "mach", "longitude": "latitude"}.get(guess.channel, ""))
    if other is None or other.topic != guess.topic or not guess.assumed:
        return guess
    if guess.channel == "longitude":
        return replace(guess, unit=other.unit, reason="in the unit of the latitude", assumed=False)
    speed, mach = (columns[each.topic, each.field] for each in (guess, other))
    moving = mach > 0.5 * float(np.nanmax(mach))
    sound = float(np.nanmedian(speed[moving] / mach[moving])) if np.any(moving) else 0.0
    for unit in ("m/s", "knot", "ft/s", "km/h"):
        if _SLOWEST_SOUND < sound * conversion(unit, "m/s")[0] < _FASTEST_SOUND:
            why = f"a speed of sound of {sound:.4g} {unit} beside the Mach number"
            return replace(guess, unit=unit, reason=why, assumed=False)
    return guess


def numeric_columns(topic: Topic) -> Iterator[tuple[str, Array]]:
    """Names and values (n,) of the columns of numbers.

    In the unit of the log; columns of text or of more dimensions are left out.
    """
    for field, values in topic.fields.items():
        column = np.asarray(values)
        if column.dtype.kind in "fiub" and column.ndim == 1:
            yield field, column.astype(np.float64)


def plain_name(field: str) -> tuple[str, str]:
    """Return the name of a field in lower case without its unit, and that unit, '' where it states
    none (`_UNIT_WORDS`).

    >>> plain_name("AoA [deg]"), plain_name("airspeed_kts"), plain_name("data.angleOfAttack")
    (('aoa', 'deg'), ('airspeed', 'knot'), ('angle_of_attack', ''))
    """
    bracket = re.search(r"[\[(]([^\])]*)[\])]\s*$", field)
    short = field[: bracket.start()] if bracket and not bracket[1].isdigit() else field
    unit = _UNIT_WORDS.get(bracket[1].strip(), "") if bracket else ""
    last = short.rsplit(".", 1)[-1].strip()
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z][a-z])", "_", last).lower()
    words = re.sub(r"[^a-z0-9/]+", "_", words).strip("_")
    for end in sorted(_UNIT_WORDS, key=len, reverse=True):
        if not unit and words.endswith(f"_{end}"):
            return words.removesuffix(f"_{end}"), _UNIT_WORDS[end]
    return words, unit


def guess_by_name(topic: Topic, field: str, values: Array) -> Guess | None:
    """The channel that a field is by its name, with its unit; None for a name of none.

    values : (n,), in the unit of the log; the guess names that unit.
    """
    words, unit = plain_name(field)
    known: str | None = field if field in CHANNELS else None
    if known is None:
        known = next((k for k, pattern in _NAMES.items() if re.fullmatch(pattern, words)), None)
        if known is None:  # Ahrs1_Pitch: the last words, with what the instrument is called before
            last = words.partition("_")[2]
            known = next((k for k, x in _NAMES.items() if last and re.fullmatch(x, last)), None)
    if known is None and is_surface(field):
        known = field
    if known is None or known == "time":
        return None
    si = channel(known).unit
    declared = topic.units.get(field, "")
    for given, why in ((declared, "the log declares the unit"), (unit, "the name states the unit")):
        if given and _fits(given, si):
            return Guess(known, topic.name, field, given, *_sign(known, values, given), why)
    size = float(np.nanpercentile(np.abs(values), 99.0))
    found = _by_range(known, si, size, values)
    guessed, why = found or (si or "1", _assumed(size))
    sign = _sign(known, values, guessed)
    return Guess(known, topic.name, field, guessed, *sign, why, assumed=found is None)


def _fits(unit: str, si: str) -> bool:
    try:
        conversion(unit, si)
    except InputError:
        return False
    return True


def _by_range(known: str, si: str, size: float, values: Array) -> tuple[str, str] | None:
    """Unit by the size of the values, and why; None where it may be another."""
    if si in _MOST:
        most = 6.3 if known in ("phi", "psi", "longitude") else _MOST[si]
        too_large = f"up to {size:.4g}: too large for {si}"
        return (_MORE[si], too_large) if size > most else None
    if known == "az_imu":
        level = abs(float(np.nanmedian(values)))
        for unit, of in (("m/s^2", 9.81), ("g", 1.0), ("ft/s^2", 32.2)):
            if 0.7 * of < level < 1.3 * of:
                return unit, f"about {level:.3g} in level flight"
    if known == "rho":
        return ("slug/ft^3", "too small for kg/m^3") if size < 0.01 else (si, f"up to {size:.3g}")
    if known == "temperature" and size < 100.0:
        return "degC", f"up to {size:.3g}: too small for K"
    if known == "mach":
        return "1", f"up to {size:.2g}"
    return None


#: Largest size of a quantity in SI, and the unit in which it is larger.
_MOST: Final = {"rad": 1.6, "rad/s": 6.0}
_MORE: Final = {"rad": "deg", "rad/s": "deg/s"}


def _assumed(size: float) -> str:
    return f"assumed: neither log nor name says so, and values up to {size:.3g} allow other units"


def _sign(known: str, values: Array, unit: str) -> tuple[float]:
    """Scale -1 for a normal acceleration that is positive upwards."""
    upward = known == "az_imu" and float(np.nanmedian(values)) > 0
    return (-1.0 if upward else 1.0,)


def clock_columns(
    recording: Recording, columns: Mapping[tuple[str, str], Array]
) -> dict[str, tuple[str, str]]:
    """Topic -> (topic, column) that runs as a time does: by name, else the first that runs evenly.

    columns : (topic, column) -> (n,).

    Times in any unit; it must increase at every sample.
    """
    found = {}
    for topic in recording.topics:
        mine = {field: values for (name, field), values in columns.items() if name == topic}
        running = [f for f, x in mine.items() if x.size > 2 and bool(np.all(np.diff(x) > 0))]
        named = [f for f in running if _TIME.fullmatch(plain_name(f)[0])]
        even = [f for f in running if _is_even(mine[f])]
        if named or even:
            found[topic] = (topic, (named or even)[0])
    return found


def _is_even(values: Array) -> bool:
    steps = np.diff(values)
    return bool(np.percentile(steps, 95) < 1.5 * np.median(steps))


def _clock_unit(field: str, values: Array) -> str:
    stated = plain_name(field)[1]
    if stated in ("s", "ms", "us"):
        return stated
    step = float(np.median(np.diff(values)))
    return "s" if step <= 2 else "ms" if step < 500 else "us" if step < 1e6 else "ns"


def _relations(
    recording: Recording,
    guesses: Mapping[str, Guess],
    clocks: Mapping[str, tuple[str, str]],
    columns: Mapping[tuple[str, str], Array],
) -> list[str]:
    """Relations that derivatives show: of guessed angles with rates, and of columns that nobody
    named."""
    said = []
    for angle, rate in _RATES:
        if angle in guesses and rate in guesses and guesses[angle].topic == guesses[rate].topic:
            pair = [columns[guesses[k].topic, guesses[k].field] for k in (angle, rate)]
            scales = [
                guesses[k].scale * conversion(guesses[k].unit, channel(k).unit)[0]
                for k in (angle, rate)
            ]
            time = seconds_of(recording, guesses[angle].topic, clocks)
            ratio = _ratio(time, pair[0] * scales[0], pair[1] * scales[1])
            if ratio is not None and not 0.5 < ratio < 2.0:
                said.append(
                    f"{rate}: it is {ratio:.3g} times the derivative of {angle}: is the unit of one"
                    " of them, or a sign, another?"
                )
    unnamed = [key for key in columns if key[1].isdigit()][:60]
    for one in unnamed:
        time = seconds_of(recording, one[0], clocks)
        for other in unnamed:
            ratio = _ratio(time, columns[one], columns[other]) if one != other else None
            if ratio is not None and one[0] == other[0]:
                said.append(f"column {other[1]} is {ratio:.3g} times the derivative of {one[1]}")
    return said[:40]


def seconds_of(
    recording: Recording,
    topic: str,
    clocks: Mapping[str, tuple[str, str]],
) -> Array:
    """Time (n,) of a topic, by its column among `clock_columns`, else by its stamps [s]."""
    if topic not in clocks:
        return np.asarray(recording.topics[topic].time, dtype=np.float64)
    values = np.array(
        next(
            np.asarray(recording.topics[topic].fields[field], dtype=np.float64)
            for _, field in [clocks[topic]]
        )
    )
    return (
        values
        * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[_clock_unit(clocks[topic][1], values)]
    )


def _ratio(time: Array, angle: Array, rate: Array) -> float | None:
    """Slope of a rate over the derivative of an angle; None where they do not move together."""
    if not (time.size == angle.size == rate.size and time.size > 20) or np.any(np.diff(time) <= 0):
        return None
    slope = np.gradient(angle, time)
    good = np.isfinite(slope) & np.isfinite(rate)
    if good.sum() < 20 or np.std(slope[good]) == 0 or np.std(rate[good]) == 0:
        return None
    if abs(np.corrcoef(slope[good], rate[good])[0, 1]) < _LEAST_CORRELATION:
        return None
    return float(np.dot(slope[good], rate[good]) / np.dot(slope[good], slope[good]))


def _text(
    recording: Recording,
    name: str,
    clock: list[str],
    derived: list[str],
    columns: Mapping[tuple[str, str], Array],
    guesses: Mapping[str, Guess],
    questions: list[str],
    left: list[tuple[str, str]],
) -> str:
    topics = list(dict.fromkeys(guess.topic for guess in guesses.values()))
    fields = sorted({g.field for g in guesses.values() if topics and g.topic == topics[0]})
    lines = [
        f"# Mapping drafted from {recording.source.rsplit('/', 1)[-1]}: check every line.",
        "# A channel is offset + scale * field in `unit`. Signs: body x forward, y right, z down;",
        "# trailing edge down and rudder left are positive (docs/reference/conventions.md).",
        *(f"# QUESTION {text}" for text in questions),
        f"name = {_quoted(name)}",
        f"formats = [{_quoted(recording.format)}]",
        f"detect = [{', '.join(map(_quoted, topics[:1]))}]",
        f"fields = [{', '.join(map(_quoted, fields))}]" if fields else "",
    ]
    lines += clock
    for guess in guesses.values():
        scale = "" if guess.scale == 1.0 else f", scale = {guess.scale:g}"
        lines += [
            "",
            f"# {_range(columns[guess.topic, guess.field])}; {guess.reason}",
            "[[channel]]",
            f"name = {_quoted(guess.channel)}",
            f"sources = [{{ topic = {_quoted(guess.topic)}, field = {_quoted(guess.field)}, unit ="
            f" {_quoted(guess.unit)}{scale} }}]",
        ]
    lines += derived
    if left:
        lines += ["", "# Not mapped: what are they?"]
        lines += [f"# {t}.{f}: {_range(columns[t, f])}" for t, f in left[:100]]
    return "\n".join(line for k, line in enumerate(lines) if line or k > 8) + "\n"


def _clock_lines(
    clocks: Mapping[str, tuple[str, str]],
    columns: Mapping[tuple[str, str], Array],
    built_in: LogMapping | None,
) -> list[str]:
    """The section [time]: a built-in mapping's, else the column that runs as a time does."""
    if built_in is not None:
        if built_in.time is None:
            return []
        topic, field = built_in.time.topic, built_in.time.field
        unit, scale = built_in.time.unit or "s", built_in.time.scale
    elif clocks:
        (topic, field), scale = next(iter(clocks.values())), 1.0
        unit = _clock_unit(field, columns[topic, field])
    else:
        return []
    lines = ["", "[time]", f"topic = {_quoted(topic)}", f"field = {_quoted(field)}"]
    return [*lines, f"unit = {_quoted(unit)}", *([f"scale = {scale!r}"] if scale != 1.0 else [])]


def _derived_lines(built_in: LogMapping) -> list[str]:
    """The channels that a built-in mapping computes."""
    lines = []
    for each in built_in.derived:
        sources = [
            f"    {{ topic = {_quoted(s.topic)}, field = {_quoted(s.field)}"
            + (f", unit = {_quoted(s.unit)}" if s.unit is not None else "")
            + (f", scale = {s.scale!r}" if s.scale != 1.0 else "")
            + " },"
            for s in each.sources
        ]
        channels = ", ".join(map(_quoted, each.channels))
        lines += ["", "[[derived]]", f"channels = [{channels}]", f"method = {_quoted(each.method)}"]
        lines += ["sources = [", *sources, "]"]
    return lines


def _range(values: Array) -> str:
    return f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}, median {np.nanmedian(values):.4g}"


def _quoted(text: Any) -> str:
    """A TOML string."""
    escaped = str(text).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub(r"[\x00-\x1f\x7f]", " ", escaped) + '"'
