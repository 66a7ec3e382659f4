"""Before and after, on flights that were not used: which flights those are, and what the candidate
does on them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.estimation import Theil, rms, theil
from aerodb.nomenclature import AXES
from aerodb.support import Array

Kind = Literal["held-out", "cross-validated", "not validated"]
Outcome = Literal["at noise floor", "improved", "unchanged", "worse", "not repaired"]

#: CONVENTIONS, "Hold-out": the newest fifth, at least two; below five flights leave-one-out.
HOLD_OUT_SHARE = 0.2
FEWEST_FOR_HOLD_OUT = 5

#: An error within this factor of the noise floor is as small as these sensors can show.
NEAR_FLOOR = 1.1
#: An error that changed by less than this share was not touched.
UNCHANGED = 0.01
#: Below this share of the measured variance explained, a structure has not described the axis,
#: whatever it removed.
EXPLAINED = 0.5


@dataclass(frozen=True)
class HoldOut:
    """Which flights identify and which validate. `kind` says what the proof is worth."""

    identified: tuple[str, ...]
    held_out: tuple[str, ...]
    kind: Kind


@dataclass(frozen=True)
class AxisValidation:
    """Error of one axis before and after; rms over all usable samples of the flights concerned.

    `*_shape` are the same without each flight's own constant. `noise_floor` is the sensor noise
    propagated into the measured coefficient; `excess_*` the error beyond it, sqrt(rms^2 - floor^2).
    None: no such flight has the axis. `repeatability` is how far flights differ among themselves:
    see the function of that name. `explained` is the share of the measured variance that the
    candidate explains. `outcome` judges the error after, on held-out flights where there are any:
    ``not repaired`` means that the declared structure does not describe the axis, ``unchanged``
    that it does not touch it.
    """

    axis: str
    rms_before: float | None
    rms_after: float | None
    held_out_rms_before: float | None
    held_out_rms_after: float | None
    held_out_shape_before: float | None
    held_out_shape_after: float | None
    excess_before: float | None
    excess_after: float | None
    noise_floor: float
    repeatability: float
    theil: Theil | None
    explained: float
    outcome: Outcome


def choose_hold_out(
    flights: Sequence[str], roles: Mapping[str, str], requested: Sequence[str] | None = None
) -> HoldOut:
    """Splits flights (oldest first) into identification and validation.

    Parameters
    ---------- flights : ids, oldest first. roles : what each was in this line of versions before
    (``identified``, ``held_out``). requested : flights to hold out; empty: none; None: by rule.

    A flight that identified an ancestor never validates, and one that was held out stays so. Raises
    UnknownNameError for a requested flight that is not among `flights`, InputError for one that
    identified before.
    """
    held = {name for name in flights if roles.get(name) == "held_out"}
    if requested is not None:
        for name in requested:
            if name not in flights:
                raise UnknownNameError(
                    f"hold-out flight '{name}' is not among these flights",
                    remedy=nearest(name, flights),
                )
            if roles.get(name) == "identified":
                what = (
                    f"flight '{name}' identified an earlier version of this line and cannot"
                    " validate"
                )
                raise InputError(
                    what,
                    "hold-out",
                    "hold out another flight, or start from a baseline that never saw it",
                )
        held |= set(requested)
    elif len(flights) >= FEWEST_FOR_HOLD_OUT:
        wanted = max(2, round(HOLD_OUT_SHARE * len(flights)))
        fresh = [name for name in flights if roles.get(name) not in ("identified", "held_out")]
        held |= set(fresh[len(fresh) - min(len(fresh), max(0, wanted - len(held))) :])
    if held:
        return _split(flights, held)
    # To leave a flight out that made the baseline what it is would prove nothing.
    unseen = not any(roles.get(name) == "identified" for name in flights)
    return HoldOut(
        tuple(flights),
        (),
        "cross-validated" if requested is None and unseen and len(flights) > 1 else "not validated",
    )


def _split(flights: Sequence[str], held: set[str]) -> HoldOut:
    identified = tuple(name for name in flights if name not in held)
    if not identified:
        raise InputError(
            "every flight is held out; none is left to identify",
            "hold-out",
            "add flights or hold out fewer",
        )
    return HoldOut(identified, tuple(name for name in flights if name in held), "held-out")


def validate_on_held_out(
    before: Mapping[str, Comparison], after: Mapping[str, Comparison], hold_out: HoldOut
) -> tuple[AxisValidation, ...]:
    """Error per axis before and after, on identification and on held-out flights (mappings from
    flight id)."""
    axes = sorted(
        {axis for comparison in before.values() for axis in comparison.usable}, key=_order
    )
    return tuple(
        _axis_validation(axis, before, after, after, hold_out.identified, hold_out.held_out)
        for axis in axes
    )


def validate_by_leaving_one_out(
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    without: Callable[[str], Comparison],
) -> tuple[AxisValidation, ...]:
    """The same where flights are too few to hold any out: each is predicted by what the others
    give.

    `after` is with all flights; `without(flight)` the comparison of that flight with a candidate
    made without it.
    """
    left_out = {flight: without(flight) for flight in before}
    flights = tuple(before)
    axes = sorted(
        {axis for comparison in before.values() for axis in comparison.usable}, key=_order
    )
    return tuple(_axis_validation(axis, before, after, left_out, flights, flights) for axis in axes)


def worse_axes(before: Mapping[str, Comparison], after: Mapping[str, Comparison]) -> frozenset[str]:
    """Body axes on which the rms error over the usable samples of all flights grew by more than
    what counts as unchanged.

    A force along the wind stands on two body axes, and on the lesser of them it is small beside
    each flight's constant: a change within `UNCHANGED` there is chance, not harm.
    """
    grown = []
    for axis in AXES:
        first, error = (
            _pooled(_residuals(axis, compared, tuple(compared))) for compared in (before, after)
        )
        if first is not None and error is not None and error > first * (1.0 + UNCHANGED):
            grown.append(axis)
    return frozenset(grown)


def _axis_validation(
    axis: str,
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    validated: Mapping[str, Comparison],
    identified: Sequence[str],
    held_out: Sequence[str],
) -> AxisValidation:
    raw = _residuals(axis, before, identified)
    fitted = _residuals(axis, after, identified)
    held_before = _residuals(axis, before, held_out)
    held_after = _residuals(axis, validated, held_out)
    every = list(dict.fromkeys([*identified, *held_out]))
    source, shown = (validated, held_out) if held_after else (after, identified)
    chosen = [source[f] for f in shown if axis in source[f].usable and source[f].usable[axis].any()]
    measured = [c.measured[axis][c.usable[axis]] for c in chosen]
    predicted = [c.predicted[axis][c.usable[axis]] for c in chosen]
    floor = _pooled([c.sigma[axis][c.usable[axis]] for c in chosen]) or 0.0
    error = _pooled(held_after) if held_after else _pooled(fitted)
    first = _pooled(held_before) if held_after else _pooled(raw)
    spread = _pooled([m - m.mean() for m in measured]) or 0.0
    explained = 1.0 - (error or 0.0) ** 2 / spread**2 if spread > 0 else 0.0
    return AxisValidation(
        axis=axis,
        rms_before=_pooled(raw),
        rms_after=_pooled(fitted),
        held_out_rms_before=_pooled(held_before),
        held_out_rms_after=_pooled(held_after),
        held_out_shape_before=_pooled([r - r.mean() for r in held_before]),
        held_out_shape_after=_pooled([r - r.mean() for r in held_after]),
        excess_before=_excess(_pooled(held_before), floor),
        excess_after=_excess(_pooled(held_after), floor),
        noise_floor=floor,
        repeatability=repeatability(
            [rms(residual) for residual in _residuals(axis, before, every)]
        ),
        theil=theil(np.concatenate(predicted), np.concatenate(measured)) if measured else None,
        explained=explained,
        outcome=_outcome(first or 0.0, error or 0.0, floor, explained),
    )


def repeatability(residuals: Sequence[float]) -> float:
    """How far one axis differs between flights of one and the same database: the sample standard
    deviation of each flight's residual rms before the update. Zero below two flights, which tell
    nothing about it.

    >>> round(repeatability([0.010, 0.012, 0.014]), 6)
    0.002
    """
    return float(np.std(residuals, ddof=1)) if len(residuals) > 1 else 0.0


def _outcome(before: float, after: float, floor: float, explained: float) -> Outcome:
    if after <= NEAR_FLOOR * floor:
        return "at noise floor"
    if abs(after - before) <= UNCHANGED * before:
        return "unchanged"
    if explained < EXPLAINED:
        return "not repaired"
    return "improved" if after < before else "worse"


def _residuals(
    axis: str, comparisons: Mapping[str, Comparison], flights: Sequence[str]
) -> list[Array]:
    chosen = [
        comparisons[f]
        for f in flights
        if axis in comparisons[f].usable and comparisons[f].usable[axis].any()
    ]
    return [c.residual(axis)[c.usable[axis]] for c in chosen]


def _pooled(residuals: list[Array]) -> float | None:
    return rms(np.concatenate(residuals)) if residuals else None


def _excess(value: float | None, floor: float) -> float | None:
    return None if value is None else float(np.sqrt(max(value**2 - floor**2, 0.0)))


def _order(axis: str) -> tuple[int, str]:
    known = ("CX", "CY", "CZ", "Cl", "Cm", "Cn", "C_lift", "C_drag", "C_side")
    return known.index(axis), axis
