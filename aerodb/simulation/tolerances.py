"""Agreement of a simulated response with the flight: tolerance bands and Theil's statistics."""

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.nomenclature import channel as channel_of
from aerodb.signals import Theil, rms, theil
from aerodb.simulation.oscillation import Oscillation
from aerodb.simulation.replay import RESPONSES
from aerodb.support import Array
from aerodb.units import quantity

#: Axes whose controls start manoeuvres.
CONTROLS: Final = ("roll", "pitch", "yaw")
#: Figures of an oscillation that a band may be about.
_FIGURES: Final[dict[str, Callable[[Oscillation], float]]] = {
    "period": lambda each: each.period,
    "half_time": lambda each: each.half_time,
    "damping": lambda each: each.zeta,
}
_UNITS: Final = {"period": "s", "half_time": "s", "damping": "1"}
#: Of a response: as simulated, None where it does not oscillate, and as flown.
Oscillations = Mapping[str, tuple[Oscillation | None, Oscillation]]
_ANGLES: Final = ("phi", "theta", "psi", "alpha", "beta")


@dataclass(frozen=True)
class ToleranceBand:
    """A response stays within +-`width` (SI) of the flight, or within `share` of the flight's
    greatest excursion from its value at the start; or, where `of` names a figure of its free
    oscillation (``period``, ``half_time`` [s], ``damping``), this figure does, `share` being that
    of the flight's."""

    channel: str
    width: float = 0.0
    share: float = 0.0
    of: str = ""

    def holds(self, simulated: Array, flown: Array) -> Array:
        """Return whether each sample is inside, (n,) of bool; NaN is outside.

        Both are (n,), in the unit of the width.
        """
        return np.asarray(np.abs(simulated - flown) <= self.limit(flown))

    def limit(self, flown: Array) -> float:
        """Return the half width (a scalar, SI) about a flown response (n,)."""
        known = flown[np.isfinite(flown)]
        excursion = float(np.abs(known - known[0]).max()) if known.size else 0.0
        return max(self.width, self.share * excursion)

    def holds_for(self, simulated: Oscillation | None, flown: Oscillation) -> bool:
        """Return whether the figure of the oscillation (period or half time [s], damping [-]) is
        inside; a response that does not oscillate as the flight does is outside."""
        if simulated is None:
            return False
        return self.deviation_of(simulated, flown) <= self.limit_of(flown)

    def limit_of(self, flown: Oscillation) -> float:
        """Return the half width about the figure of the flown oscillation (s, damping [-])."""
        return max(self.width, self.share * abs(_FIGURES[self.of](flown)))

    def deviation_of(self, simulated: Oscillation, flown: Oscillation) -> float:
        """Return how far the figure is from that of the flight (s, damping [-])."""
        theirs, ours = (_FIGURES[self.of](each) for each in (flown, simulated))
        return abs(ours - theirs)


@dataclass(frozen=True)
class ToleranceCheck:
    """A tolerance: at each sample any of `bands` must hold ("A or B"), over at least
    `required_share` of the samples. It applies to manoeuvres that start with a control of the axes
    `controls`; without any, to all. test : number of its paragraph, or empty."""

    name: str
    bands: tuple[ToleranceBand, ...]
    controls: tuple[str, ...] = ()
    required_share: float = 1.0
    test: str = ""


@dataclass(frozen=True)
class StandardTest:
    """A test of a standard: number of its paragraph, title, the flight condition that it asks for,
    what of its tolerance no check judges, and what was compared with the standard's text."""

    number: str
    title: str
    condition: str = ""
    not_judged: str = ""
    compared: str = ""


@dataclass(frozen=True)
class Tolerances:
    """A named set of checks, and the tests of the standard that they belong to.

    source : the text that the tests' numbers are of. unchecked : standards that ask the same in
    paragraphs that were not compared with their text.
    """

    name: str
    checks: tuple[ToleranceCheck, ...]
    source: str = ""
    tests: tuple[StandardTest, ...] = ()
    unchecked: tuple[str, ...] = ()


@dataclass(frozen=True)
class BandResult:
    """Largest deviation of a response, or of a figure `of` its oscillation, and the tolerance.

    Both are in SI units; None where the flight has no such figure, or the simulation ended early
    or does not oscillate.
    """

    channel: str
    of: str
    limit: float | None
    deviation: float | None


@dataclass(frozen=True)
class CheckResult:
    """Result of a check on one manoeuvre: share of samples inside, and whether that is enough.

    required : that share. test : number of its paragraph, or empty. bands : what deviated by how
    much.
    """

    check: str
    share: float
    passed: bool
    required: float = 1.0
    test: str = ""
    bands: tuple[BandResult, ...] = ()


@dataclass(frozen=True)
class ResponseAgreement:
    """Agreement of one response: rms error and rms of the flown response about its start (SI), with
    Theil's statistics of the changes since the start."""

    channel: str
    rms_error: float
    rms_flown: float
    theil: Theil


def parse_tolerances(text: str, where: str = "tolerances") -> Tolerances:
    """Return tolerances from TOML; `aerodb/simulation/tolerances.toml` shows the form.

    Raises InputError naming the entry that is wrong. Widths are in the channel's unit, shares
    dimensionless.
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is no TOML: {error}", where) from None
    entries = document.get("check")
    if not isinstance(entries, list) or not entries:
        raise InputError("has no [[check]]", where, "add one with name and bands")
    tests = tuple(
        _test(entry, f"{where}, test {k}") for k, entry in enumerate(document.get("test", ()), 1)
    )
    numbers = [test.number for test in tests]
    checks = tuple(
        _check(entry, f"{where}, check {k}", numbers) for k, entry in enumerate(entries, 1)
    )
    return Tolerances(
        str(document.get("name", where)),
        checks,
        str(document.get("source", "")),
        tests,
        tuple(str(name) for name in document.get("unchecked", ())),
    )


def _test(entry: Mapping[str, Any], where: str) -> StandardTest:
    _known(entry, ("number", "title", "condition", "not_judged", "compared"), where)
    if not entry.get("number"):
        raise InputError("has no number", where, 'for example number = "2.c.10"')
    return StandardTest(**{name: str(value) for name, value in {"title": "", **entry}.items()})


def _check(entry: Mapping[str, Any], where: str, tests: Sequence[str]) -> ToleranceCheck:
    _known(entry, ("name", "bands", "controls", "required_share", "test"), where)
    test = str(entry.get("test", ""))
    if test and test not in tests:
        raise InputError(f"no [[test]] has the number '{test}'", where, nearest(test, tests))
    controls = tuple(entry.get("controls", ()))
    for axis in controls:
        if axis not in CONTROLS:
            raise InputError(f"unknown control axis '{axis}'", where, nearest(axis, CONTROLS))
    bands = tuple(_band(band, where) for band in entry.get("bands", ()))
    if len({bool(band.of) for band in bands}) > 1:
        raise InputError("mixes time histories with figures of an oscillation", where, "two checks")
    share = entry.get("required_share", 1.0)
    if not bands:
        raise InputError("has no bands", where, 'for example bands = [{ channel = "q", width ='
                         ' "2 deg/s" }]')  # fmt: skip
    if not isinstance(share, int | float) or not 0.0 < share <= 1.0:
        raise InputError(f"required_share is {share!r}", where, "give a number above 0, up to 1")
    return ToleranceCheck(str(entry.get("name", where)), bands, controls, float(share), test)


def _band(entry: Mapping[str, Any], where: str) -> ToleranceBand:
    _known(entry, ("channel", "width", "share", "of"), where)
    channel = str(entry.get("channel"))
    if channel not in RESPONSES:
        raise InputError(f"unknown response '{channel}'", where, nearest(channel, RESPONSES))
    share = entry.get("share", 0.0)
    of = str(entry.get("of", ""))
    if of and of not in _FIGURES:
        raise InputError(f"unknown figure '{of}'", where, nearest(of, _FIGURES))
    value = quantity(entry.get("width", 0.0), _UNITS[of] if of else channel_of(channel).unit)
    if not (value > 0.0 or share > 0.0):
        raise InputError(f"the band of {channel} has no width", where, 'give width = "2 deg/s"')
    return ToleranceBand(channel, value, float(share), of)


def _known(entry: Mapping[str, Any], names: tuple[str, ...], where: str) -> None:
    for name in entry:
        if name not in names:
            raise InputError(f"unknown key '{name}'", where, nearest(name, names))


def check_responses(
    tolerances: Tolerances,
    simulated: Mapping[str, Array],
    flown: Mapping[str, Array],
    controls: Iterable[str],
    unjudged: Iterable[str] = (),
    oscillations: Oscillations | None = None,
) -> tuple[CheckResult, ...]:
    """Check a manoeuvre against the tolerances that apply to it.

    Parameters
    ----------
    simulated, flown : response -> (n,), SI; samples where the flight is NaN do not count, samples
        where the simulation is NaN (it diverged) are outside.
    controls : axes whose control starts the manoeuvre.
    unjudged : responses that cannot be judged; checks that need them are left out.
    oscillations : of the flight's free response, and what the simulation has in its place.
    """
    results, axes, out = [], set(controls), set(unjudged)
    for check in tolerances.checks:
        bands = [b for b in check.bands if b.channel in flown and b.channel not in out]
        if (check.controls and not axes & set(check.controls)) or len(bands) < len(check.bands):
            continue
        if any(b.of for b in bands):
            known = oscillations or {}
            if all(b.of and b.channel in known for b in bands):
                held = any(b.holds_for(*known[b.channel]) for b in bands)
                figures = _figure_results(bands, known)
                results.append(CheckResult(check.name, float(held), held, 1.0, check.test, figures))
            continue
        counted = np.all([np.isfinite(flown[b.channel]) for b in bands], axis=0)
        pairs = {b.channel: (_unwrapped(b.channel, simulated), _unwrapped(b.channel, flown))
                 for b in bands}  # fmt: skip
        inside = np.any([b.holds(*pairs[b.channel]) for b in bands], axis=0)
        if counted.any():
            share = float(np.mean(inside[counted]))
            results.append(
                CheckResult(
                    check.name,
                    share,
                    share >= check.required_share,
                    check.required_share,
                    check.test,
                    _band_results(bands, pairs, counted),
                )
            )
    return tuple(results)


def _band_results(
    bands: Iterable[ToleranceBand], pairs: Mapping[str, tuple[Array, Array]], counted: Array
) -> tuple[BandResult, ...]:
    """Of each response (simulated and flown, (n,)): the widest of its bands, and the largest
    deviation over the samples that count."""
    widest = dict.fromkeys(pairs, 0.0)
    for band in bands:
        widest[band.channel] = max(widest[band.channel], band.limit(pairs[band.channel][1]))
    return tuple(
        BandResult(name, "", widest[name], _finite(np.abs(ours - theirs)[counted].max()))
        for name, (ours, theirs) in pairs.items()
    )


def _figure_results(bands: Iterable[ToleranceBand], known: Oscillations) -> tuple[BandResult, ...]:
    """The same of figures of oscillations."""
    found: dict[tuple[str, str], BandResult] = {}
    for band in bands:
        ours, theirs = known[band.channel]
        limit, former = band.limit_of(theirs), found.get((band.channel, band.of))
        if former is not None and former.limit is not None:
            limit = max(limit, former.limit)
        away = None if ours is None else _finite(band.deviation_of(ours, theirs))
        found[band.channel, band.of] = BandResult(band.channel, band.of, _finite(limit), away)
    return tuple(found.values())


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def response_agreement(
    simulated: Mapping[str, Array], flown: Mapping[str, Array]
) -> tuple[ResponseAgreement, ...]:
    """Return Theil's statistics (dimensionless) and rms errors (SI units) of all responses (n,)
    that both have, of at least 3 samples."""
    found = []
    for channel in RESPONSES:
        if channel not in flown or channel not in simulated:
            continue
        ours, theirs = _unwrapped(channel, simulated), _unwrapped(channel, flown)
        good = np.isfinite(ours) & np.isfinite(theirs)
        if good.sum() < 3:
            continue
        start = theirs[good][0]
        found.append(
            ResponseAgreement(
                channel,
                rms(ours[good] - theirs[good]),
                rms(theirs[good] - start),
                theil(ours[good] - start, theirs[good] - start),
            )
        )
    return tuple(found)


def _unwrapped(channel: str, values: Mapping[str, Array]) -> Array:
    series = values[channel]
    if channel not in _ANGLES:
        return series
    result, good = series.copy(), np.isfinite(series)
    result[good] = np.unwrap(series[good])
    return result
