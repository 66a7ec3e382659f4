"""Validation of an update: choose the held-out flights, and compare errors before and after.

The rule is described in docs/method/updates.md, "Hold-out".
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.increments.held_out import NEAR_FLOOR, UNCHANGED
from aerodb.nomenclature import AXES, in_order
from aerodb.signals import Theil, rms, theil
from aerodb.support import HALF, NOTABLE, SMALL, Array
from aerodb.tables import WIND_AXES

Kind = Literal["held-out", "cross-validated", "not validated"]
Outcome = Literal["at noise floor", "improved", "unchanged", "worse", "not repaired"]

#: Share of the flights that is held out, the newest, at least two (docs/method/updates.md,
#: "Hold-out").
HOLD_OUT_SHARE = NOTABLE
#: Flights from which some are held out; below, each is left out in turn.
FEWEST_FOR_HOLD_OUT = 5

#: Part of the samples in which what is added is less than this part of its largest value, where
#: flights are flown without it.
_NIL = SMALL
#: A declared structure that explains less than this fraction of the measured variance does not
#: describe the axis, however much it reduced the error.
EXPLAINED = HALF


@dataclass(frozen=True)
class HoldOut:
    """Which flights identify and which validate; `kind` is how the update is validated."""

    identified: tuple[str, ...]
    held_out: tuple[str, ...]
    kind: Kind


@dataclass(frozen=True)
class AxisValidation:
    """Error of one axis before and after an update.

    Errors are rms over all usable samples of the flights concerned; None where no such flight has
    the axis.

    Parameters
    ----------
    rms_before, rms_after : on the identifying flights.
    held_out_rms_before, held_out_rms_after : on the held-out flights.
    held_out_shape_before, held_out_shape_after : the same without each flight's own mean.
    excess_before, excess_after : held-out error beyond the noise floor, sqrt(rms^2 - floor^2).
    noise_floor : what the true model would leave: noise of the sensors, and what reconstruction
        does not know of the state.
    repeatability : how much flights differ among themselves; see `repeatability`.
    theil : Theil statistics of the prediction after the update.
    explained : fraction of the measured variance that the candidate explains.
    unit : of the errors: dimensionless, but for the outputs of rolls (`ROLL_OUTPUTS`).
    outcome : judgement of the error after, on held-out flights where there are any. ``not
        repaired``: the declared structure does not describe the axis. ``unchanged``: the update
        does not affect it.
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
    unit: str = "1"


def choose_hold_out(
    flights: Sequence[str], roles: Mapping[str, str], requested: Sequence[str] | None = None
) -> HoldOut:
    """Split flights into identification and validation.

    Parameters
    ----------
    flights : ids, oldest first.
    roles : flight -> its role in this line of versions so far, ``identified`` or ``held_out``.
    requested : flights to hold out; empty: none; None: by rule.

    A flight that identified an ancestor never validates, and a flight that was held out stays held
    out.

    Raises UnknownNameError for a requested flight that is not among `flights`, InputError for one
    that identified before.
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
    # Leaving out a flight that the baseline was identified from would validate nothing.
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
            "every flight is held out; none is left for identification",
            "hold-out",
            "add flights, or hold out fewer",
        )
    return HoldOut(identified, tuple(name for name in flights if name in held), "held-out")


@dataclass(frozen=True)
class NoiseFloor:
    """The rms error that the true model would leave on an axis of a flight: of its mean (`level`)
    and about it (`shape`), dimensionless."""

    level: float
    shape: float

    @property
    def total(self) -> float:
        """Of both, rms."""
        return float(np.hypot(self.level, self.shape))


#: Flight (id) -> axis -> what the true model would leave there.
Floors = Mapping[str, Mapping[str, NoiseFloor]]


def validate_on_held_out(
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    hold_out: HoldOut,
    floors: Floors | None = None,
) -> tuple[AxisValidation, ...]:
    """Error per axis before and after, on the identifying and on the held-out flights.

    before, after : flight id -> comparison with the baseline and with the candidate. floors : where
    they are known (`aerodb.loop.noise_floors_of`); else the noise of the sensors in the
    coefficients.

    Errors are rms of dimensionless coefficients over residuals (n,); None where no flight has the
    axis.
    """
    axes = sorted(
        {axis for comparison in before.values() for axis in comparison.usable}, key=_order
    )
    return tuple(
        _axis_validation(axis, before, after, after, hold_out.identified, hold_out.held_out, floors)
        for axis in axes
    )


def validate_by_leaving_one_out(
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    without: Callable[[str], Comparison],
    floors: Floors | None = None,
) -> tuple[AxisValidation, ...]:
    """Error per axis before and after by leave-one-out cross-validation, for few flights.

    Errors are rms of dimensionless coefficients over residuals (n,); None where no flight has the
    axis.

    Parameters
    ----------
    before : flight id -> comparison with the baseline.
    after : flight id -> comparison with the candidate from all flights.
    without : flight id -> its comparison with a candidate estimated without it.
    floors : as for `validate_on_held_out`.
    """
    left_out = {flight: without(flight) for flight in before}
    flights = tuple(before)
    axes = sorted(
        {axis for comparison in before.values() for axis in comparison.usable}, key=_order
    )
    return tuple(
        _axis_validation(axis, before, after, left_out, flights, flights, floors) for axis in axes
    )


def worse_axes(before: Mapping[str, Comparison], after: Mapping[str, Comparison]) -> frozenset[str]:
    """Body axes and hinge moments on which the error over the usable samples of all flights grew by
    more than the fraction `UNCHANGED`.

    The error is the rms, once about each flight's mean and once as it is. What grew only as it is
    is excused if a part of the flights is flown where what was added is nil, and the error about
    the means fell, on the axis or on the three forces together in units of their noise: then what
    was added is right about the changes within flights, and the level of the axis has another
    error, such as that of a centre of gravity or of a surface's zero.

    What grew only about the means is excused where its mean square grew by less than the fraction
    `UNCHANGED` of what that of the error as it is fell by: a level that was repaired beside a drag
    whose small component along z is chance.

    A force along x or z counts only where lift or drag became worse, too: a repaired lift takes
    away what its error along x had hidden of a thrust that is off, and drag knows nothing of it.

    The margin is needed because a force along a wind axis acts on two body axes. On the smaller of
    its components it is small against each flight's constant, and a small growth there is chance.
    """
    given = in_order({*AXES, *(axis for each in before.values() for axis in each.usable)})
    body, wind = (_grown(axes, before, after) for axes in (given, WIND_AXES))
    if wind is None or body is None or wind & {"C_lift", "C_drag"}:
        return body or frozenset()
    return body - {"CX", "CZ"}


def _grown(
    axes: Sequence[str], before: Mapping[str, Comparison], after: Mapping[str, Comparison]
) -> frozenset[str] | None:
    """Those of the axes, the first three of them forces, on which the error grew, as for
    `worse_axes`; None where no flight has any."""
    whole, varying, excused = {}, {}, {}
    for axis in axes:
        pairs = [_residuals(axis, compared, tuple(compared)) for compared in (before, after)]
        if not all(pairs):
            continue
        unit = _pooled([c.sigma[axis][c.usable[axis]] for c in after.values() if axis in c.usable])
        whole[axis], varying[axis] = (
            [(_pooled(each) or 0.0) / (unit or 1.0) for each in residuals]
            for residuals in (pairs, [[r - r.mean() for r in each] for each in pairs])
        )
        added = np.abs(np.concatenate(pairs[1]) - np.concatenate(pairs[0]))
        excused[axis] = np.quantile(added, _NIL) <= _NIL * added.max()

    def falls(axes: Sequence[str]) -> bool:
        first, error = (rms(np.array([varying[axis][k] for axis in axes])) for k in (0, 1))
        return error < first * (1.0 - UNCHANGED)

    forces = [axis for axis in axes[:3] if axis in varying]
    if not whole:
        return None
    return frozenset(
        axis
        for axis, (first, error) in whole.items()
        if (
            varying[axis][1] > varying[axis][0] * (1.0 + UNCHANGED)
            and varying[axis][1] ** 2 - varying[axis][0] ** 2 > UNCHANGED * (first**2 - error**2)
        )
        or (
            error > first * (1.0 + UNCHANGED)
            and not (excused[axis] and (falls([axis]) or (axis in forces and falls(forces))))
        )
    )


def _axis_validation(
    axis: str,
    before: Mapping[str, Comparison],
    after: Mapping[str, Comparison],
    validated: Mapping[str, Comparison],
    identified: Sequence[str],
    held_out: Sequence[str],
    floors: Floors | None,
) -> AxisValidation:
    raw = _residuals(axis, before, identified)
    fitted = _residuals(axis, after, identified)
    held_before = _residuals(axis, before, held_out)
    held_after = _residuals(axis, validated, held_out)
    every = list(dict.fromkeys([*identified, *held_out]))
    source, shown = (validated, held_out) if held_after else (after, identified)
    named = [f for f in shown if axis in source[f].usable and source[f].usable[axis].any()]
    chosen = [source[f] for f in named]
    measured = [c.measured[axis][c.usable[axis]] for c in chosen]
    predicted = [c.predicted[axis][c.usable[axis]] for c in chosen]
    error = _pooled(held_after) if held_after else _pooled(fitted)
    floor = _floor(axis, dict(zip(named, chosen, strict=True)), floors or {})
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
        outcome=axis_outcome(first or 0.0, error or 0.0, floor, explained),
    )


def repeatability(residuals: Sequence[float]) -> float:
    """Return how much one axis differs between flights under the same database.

    The sample standard deviation of each flight's residual rms before the update; zero for fewer
    than two flights, where it is not known.

    residuals : (m,) rms of m flights, dimensionless.

    >>> round(repeatability([0.010, 0.012, 0.014]), 6)
    0.002
    """
    return float(np.std(residuals, ddof=1)) if len(residuals) > 1 else 0.0


def axis_outcome(before: float, after: float, floor: float, explained: float) -> Outcome:
    """Return what an error after an update is beside that before and the noise floor, all rms in
    one unit.

    explained : part of the measured variance.
    """
    if after <= NEAR_FLOOR * floor:
        return "at noise floor"
    if abs(after - before) <= UNCHANGED * before:
        return "unchanged"
    if explained < EXPLAINED:
        return "not repaired"
    return "improved" if after < before else "worse"


def _floor(axis: str, comparisons: Mapping[str, Comparison], floors: Floors) -> float:
    """The rms error on an axis that the true model would leave on these flights.

    What priors allow of the state may be more than a flight has: the right database leaves no
    larger mean of a flight than the candidate, and no larger error about it, but for the sensors'
    noise. A mean that the state may explain is no excuse for an error about it, nor one flight's
    error for another's.
    """
    squares, samples = 0.0, 0
    for flight, compared in comparisons.items():
        good = compared.usable[axis]
        residual, white = compared.residual(axis)[good], rms(compared.sigma[axis][good])
        known = floors.get(flight, {}).get(axis, NoiseFloor(0.0, white))
        level = min(known.level, abs(float(residual.mean())))
        shape = max(white, min(known.shape, float(residual.std())))
        squares += len(residual) * (level**2 + shape**2)
        samples += len(residual)
    return float(np.sqrt(squares / samples)) if samples else 0.0


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
    return known.index(axis) if axis in known else len(known), axis
