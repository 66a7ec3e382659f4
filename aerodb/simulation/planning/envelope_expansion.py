"""Expansion of the flown envelope: the next point at which all margins hold with what is known."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, UnknownNameError
from aerodb.nomenclature import channel
from aerodb.simulation.condition import Condition
from aerodb.simulation.engine import FlightModel, flight_model
from aerodb.simulation.linear_model import linear_model
from aerodb.simulation.sweep import SweepPoint, sweep
from aerodb.simulation.trim import Trim
from aerodb.tables import AeroDatabase, Increment, parse
from aerodb.units import SI

#: Points at which the margins are looked at, from the edge of the envelope to its largest step.
POINTS: Final = 9
#: Estimate of an unknown change: an increment of zeros would not act at all.
_NOTHING: Final = 1e-12


@dataclass(frozen=True)
class Growth:
    """What may change beyond the flown envelope: a derivative, in proportion to the distance.

    Parameters
    ----------
    axis : of the coefficient.
    term : regressor, such as ``delta_elevator``; that of `across` itself counts from the edge.
    standard_error : of the derivative, per unit [SI] of `across` beyond the edge.
    across : channel in which the distance is measured.
    """

    axis: str
    term: str
    standard_error: float
    across: str = "alpha"


@dataclass(frozen=True)
class Margins:
    """What must hold at every permitted point, with `sigmas` standard errors.

    Parameters
    ----------
    control : share of each control's range that must be left at either end.
    growth_rate : largest real part of a mode [1/s].
    channels : channel or input of the trim -> least and greatest value [SI].
    load_factor : of a pull-up that must be possible with all other margins held; None: none.
    """

    sigmas: float = 2.0
    control: float = 0.1
    growth_rate: float = 0.1
    channels: Mapping[str, tuple[float, float]] | None = None
    load_factor: float | None = None


@dataclass(frozen=True)
class ExpansionPoint:
    """A point, and the sentences that say which margins do not hold there."""

    value: float
    violations: tuple[str, ...]


@dataclass(frozen=True)
class Expansion:
    """The next permitted point.

    Parameters
    ----------
    value : of the variable [SI]; the edge itself where no step is permitted.
    reached : whether it is the target.
    stopped_by : what does not hold beyond it; empty for a full step.
    points : those that were looked at, from the edge on.
    """

    value: float
    reached: bool
    stopped_by: tuple[str, ...]
    points: tuple[ExpansionPoint, ...]


def expand_envelope(
    database: AeroDatabase,
    condition: Condition,
    inputs: Mapping[str, float],
    variable: str,
    edge: float,
    target: float,
    largest_step: float,
    margins: Margins,
    growth: Sequence[Growth] = (),
    *,
    build: Callable[[AeroDatabase], FlightModel] = flight_model,
    **options: Any,
) -> Expansion:
    """Return the point farthest from the edge of the flown envelope such that all margins hold at
    it and on the way to it.

    Parameters
    ----------
    database : its increments' covariance is what is known.
    condition, inputs, options : as of `aerodb.simulation.trim`; limits of controls among them.
    variable : V, altitude or another of the condition. edge, target, largest_step : of it [SI].
    growth : what may change beyond the edge. build : from a database to what flies.

    Trims and linear models move with the estimates to first order (`aerodb.simulation.trim`); a
    margin holds if it does at `margins.sigmas` of the standard error. Without `growth`, only the
    estimates' own covariance counts.

    Raises InputError where the margins do not even hold at the edge, or the range is empty.

    References
    ----------
    Idea: automatic envelope expansion, R. Jategaonkar (DLR), lecture on flight vehicle system
    identification; margins with standard errors: this product's own.
    """
    distance = target - edge
    if not (np.isfinite(distance) and distance != 0.0 and largest_step > 0.0):
        raise InputError(
            f"no step from {edge:g} towards {target:g}", "expansion", "give a range and a step"
        )
    step = np.sign(distance) * min(abs(distance), largest_step)
    line = (edge + step * np.linspace(0.0, 1.0, POINTS)).tolist()
    (first,) = sweep(build(database), condition, inputs, variable, [edge], **options)
    wider = database if first.trim is None else _with_growth(database, first.trim.channels, growth)
    looked = _looked_at(build(wider), condition, inputs, variable, line, margins, options)
    if looked[0].violations:
        raise InputError(
            "; ".join(looked[0].violations),
            f"where it begins, {variable} {_shown(variable, edge)}",
            "fly there for smaller standard errors, or state other margins",
        )
    good = next((k for k, point in enumerate(looked) if point.violations), POINTS) - 1
    stopped = looked[good + 1].violations if good + 1 < POINTS else ()
    whole = good == POINTS - 1 and abs(distance) <= largest_step
    return Expansion(target if whole else line[good], whole, stopped, looked)


def _with_growth(
    database: AeroDatabase, edge: Mapping[str, float], growth: Sequence[Growth]
) -> AeroDatabase:
    """The database with an unknown change of derivatives beyond the edge (channels of its trim)."""
    added = []
    for each in growth:
        if each.across not in edge:
            raise InputError(f"a trim has no channel '{each.across}'", "growth", "such as alpha")
        beyond = f"({each.across} - ({edge[each.across]!r}))"
        term = beyond if each.term == each.across else f"({each.term})"
        expression = parse(f"{term}*abs{beyond}")
        variance = np.array([[each.standard_error**2]])
        added.append(Increment(each.axis, (expression,), np.array([_NOTHING]), variance))
    return replace(database, increments=(*database.increments, *added))


def _looked_at(
    model: FlightModel,
    condition: Condition,
    inputs: Mapping[str, float],
    variable: str,
    line: Sequence[float],
    margins: Margins,
    options: Mapping[str, Any],
) -> tuple[ExpansionPoint, ...]:
    """The points of a line with what does not hold at each."""
    limits = options.get("limits") or {}
    along = sweep(model, condition, inputs, variable, line, **options)
    found = [list(_violations(point, margins, limits, True)) for point in along]
    if margins.load_factor is not None:
        pull = replace(condition, load_factor=margins.load_factor, pull_up=True)
        name = f"in a pull-up to {margins.load_factor:g} g: "
        for k, point in enumerate(sweep(model, pull, inputs, variable, line, **options)):
            found[k] += [name + text for text in _violations(point, margins, limits, False)]
    return tuple(
        ExpansionPoint(value, tuple(texts)) for value, texts in zip(line, found, strict=True)
    )


def _shown(name: str, value: float) -> str:
    """A value of a channel or input with its unit, angles in degrees."""
    try:
        return SI.shown(value, channel(name).unit)
    except UnknownNameError:
        return f"{value:.3g}"


def _violations(
    point: SweepPoint,
    margins: Margins,
    limits: Mapping[str, tuple[float, float]],
    steady: bool,
) -> list[str]:
    """Sentences on the margins that do not hold at a point; modes are those of steady flight."""
    if point.trim is None:
        return [point.reason]
    values = {**point.trim.channels, **point.trim.deflections}
    errors, texts = point.trim.standard_errors, []
    held = {
        name: (low + margins.control * (high - low), high - margins.control * (high - low))
        for name, (low, high) in limits.items()
        if name in values and np.isfinite(high - low)
    }
    for name, (low, high) in {**held, **(margins.channels or {})}.items():
        if name not in values:
            raise InputError(f"a trim has no channel '{name}'", "margins", ", ".join(values))
        value, error = values[name], errors.get(name, 0.0)
        if not low <= value - margins.sigmas * error <= value + margins.sigmas * error <= high:
            known = f" with standard error {_shown(name, error)}" if error else ""
            texts.append(
                f"{name} {_shown(name, value)}{known} is outside {_shown(name, low)} to"
                f" {_shown(name, high)}"
            )
    if steady:
        expected, greatest = _growth_rates(point.trim, margins.sigmas)
        if not greatest <= margins.growth_rate:
            texts.append(
                f"a mode may grow at {greatest:.3g}/s within {margins.sigmas:g} standard errors"
                f" ({expected:.3g}/s expected), permitted {margins.growth_rate:.3g}/s"
            )
    return texts


def _growth_rates(found: Trim, sigmas: float) -> tuple[float, float]:
    """Largest real part of the eigenvalues [1/s], expected and within `sigmas` standard errors.

    For each entry of A the estimates move together, within their ellipsoid, to where that entry is
    smallest and largest. Standard errors of eigenvalues would not do: to first order, the real part
    of a short period does not depend on the static stability that keeps it from diverging.
    """
    linear = linear_model(found)
    every = [linear.A]
    if linear.A_slopes is not None and linear.covariance is not None:
        p = len(linear.covariance)
        slopes = linear.A_slopes.reshape(-1, p)
        directions = slopes @ linear.covariance
        sizes = np.sqrt(np.maximum(np.einsum("ep,ep->e", directions, slopes), 0.0))
        moved = directions[sizes > 0.0] / sizes[sizes > 0.0, None]
        change = sigmas * np.einsum("ijp,ep->eij", linear.A_slopes, moved)
        every += [*(linear.A + change), *(linear.A - change)]
    rates = np.linalg.eigvals(np.array(every)).real.max(axis=1)
    return float(rates[0]), float(rates.max())
