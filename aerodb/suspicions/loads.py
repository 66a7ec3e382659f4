"""Mass, centre of gravity and thrust of a vehicle file against the vehicle's database.

Each leaves a mark of its own on what a flight measures. A wrong mass multiplies all forces by one
factor and no moment; a CG at a wrong place adds moments in proportion to the forces, about two axes
at once; a thrust that is missing leaves less drag than the aircraft has (003, eqs. 1-4).
Aerodynamics may look alike: what they can imitate is only named (kind `POSSIBLE`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import BAND, Suspicion
from aerodb.estimation import Regression, least_squares
from aerodb.flight import Flight
from aerodb.nomenclature import MOMENT_AXES, is_surface
from aerodb.physics import GRAVITY
from aerodb.signals import low_passed
from aerodb.support import HALF, MINUTE, SUBSTANTIAL, Array, half_interval
from aerodb.suspicions.derivatives import AxisShares, Share, whole_surface
from aerodb.suspicions.drag import ACCELERATION, ANGLE
from aerodb.suspicions.evidence import (
    ERRORS,
    FEWEST,
    INFLATION,
    RATIOS,
    SCATTER,
    SWING,
    WELL_EXPLAINED,
)
from aerodb.suspicions.surfaces import role_of
from aerodb.tables import ReferenceGeometry
from aerodb.vehicle import Vehicle

#: Kind of suspicion that aerodynamics may explain as well: said, but no fault of the flight.
POSSIBLE = "possible"
#: Least factor that all forces share.
FACTOR = 1.1
#: Fewest moment derivatives that a factor is compared with, or shared by.
FEWEST_MOMENTS = 4
#: Least shift of the CG, in chords.
SHIFT = 0.05
#: Largest share of the database's drag that is too little: tunnels without trim, roughness and
#: cooling measure less drag than flight does, seldom more.
LITTLE = HALF
#: Share of the database's drag below which a thrust is none.
NOTHING = MINUTE
#: Newtons of a pound of force [N].
_POUND_FORCE = 4.4482
#: Relative difference up to which a factor is that of pounds of force.
_NEAR = SUBSTANTIAL


@dataclass(frozen=True)
class Ratio:
    """Change of a measured coefficient over that of the predicted one, its standard error, and the
    share of the change that is explained."""

    value: float
    error: float
    explained: float


def force_ratio(
    measured: Array, predicted: Array, good: NDArray[np.bool_], step: float
) -> Ratio | None:
    """Return the slope of a measured over a predicted coefficient, (n,) each, below the upper
    edge of the band; None where the samples `good`, `step` s apart, do not give one."""
    if int(good.sum()) < FEWEST:
        return None
    band = min(BAND[1], 0.4 / step)
    try:
        x, y = (
            low_passed(np.where(good, values, np.nan), step, band)[good]
            for values in (predicted, measured)
        )
        fit = least_squares(np.column_stack([x, np.ones_like(x)]), y, ("predicted", "1"))
    except ValueError:
        return None
    return Ratio(float(fit.estimates[0]), float(fit.standard_errors[0]), fit.r_squared)


def thrust_beside(
    flight: Flight,
    vehicle: Vehicle,
    area: float,
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
) -> list[Suspicion]:
    """Return a logged thrust that leaves less than `LITTLE` of the database's drag, beyond what
    accelerometer and angle of attack may err by, or with whose changes the drag left changes as
    only another thrust makes it.

    area : m^2, that the coefficients refer to.

    measured, predicted : coefficient -> (n,). usable : the same, masks. Source:
    `docs/method/consistency.md`, section "Against the database".
    """
    lines = vehicle.thrust.lines
    if vehicle.thrust.source != "channel" or "C_drag" not in measured or "qbar" not in flight:
        return []
    if any(name not in flight for name in lines):
        return []
    good = usable["C_drag"] & (flight["qbar"] > 0.0) & np.isfinite(predicted["C_drag"])
    good &= np.isfinite(measured["C_drag"]) & flight.usable(lines)
    if int(good.sum()) < FEWEST:
        return []
    here, there, lift = (
        float(np.median(values[good]))
        for values in (measured["C_drag"], predicted["C_drag"], measured["C_lift"])
    )
    margin = abs(lift) * (ANGLE + ACCELERATION / GRAVITY)
    total = np.asarray(sum(flight[name] for name in lines))
    logged = np.where(good, total, np.nan) / (np.where(good, flight["qbar"], np.nan) * area)
    if not (here <= LITTLE * there and there - here >= margin):
        return _changing_thrust(flight, logged, measured, predicted, good)
    thrust = float(np.median(logged[good]))
    lost = abs(thrust) < NOTHING * there
    factor = np.inf if lost else (thrust + there - here) / thrust
    cause = "no thrust was recorded" if lost else _cause(factor)
    words = (
        f"without the logged thrust the drag coefficient is {here:.3g} (median), and the database"
        f" has {there:.3g}: {cause}, or the database has gear, flaps or brakes out"
    )
    evidence = {"measured": here, "predicted": there, "thrust": thrust}
    return [Suspicion("thrust", "size", words, evidence)]


def _cause(factor: float) -> str:
    if factor < 0.0:
        return "the sign of the thrust is flipped"
    pounds = abs(factor / _POUND_FORCE - 1.0) < _NEAR
    return f"the thrust is {factor:.3g} times what is logged{' (lbf taken for N)' * pounds}"


def _changing_thrust(
    flight: Flight,
    logged: Array,
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    good: NDArray[np.bool_],
) -> list[Suspicion]:
    """Return a thrust coefficient, (n,), that is another by the factor with which the drag left
    changes with it: a thrust of k times what is logged leaves (1 - k) of it.

    Errors of alpha leave lift in the drag, those of the database drag and that of flaps and brakes;
    noise of the thrust brings k nearer to one.
    """
    columns = {
        "left": measured["C_drag"] - predicted["C_drag"],
        "thrust": logged,
        "C_lift": measured["C_lift"],
        "C_drag": predicted["C_drag"],
    }
    for name in filter(is_surface, flight.channels):
        if not role_of(name) and np.nanstd(flight[name][good]) > SWING:
            whole = whole_surface(name, flight)
            columns[whole] = columns.get(whole, 0.0) + flight[name]
    good = good & np.all([np.isfinite(values) for values in columns.values()], axis=0)
    if int(good.sum()) < FEWEST:
        return []
    band = min(BAND[1], 0.4 / flight.step)
    try:
        parts = {
            name: low_passed(np.where(good, values, np.nan), flight.step, band)[good]
            for name, values in columns.items()
            if np.ptp(values[good]) > 0.0
        }
        left, ones = parts.pop("left"), np.ones(int(good.sum()))
        fit = least_squares(np.column_stack([*parts.values(), ones]), left, (*parts, "1"))
    except (KeyError, ValueError):  # nothing is left, or columns are not told apart
        return []
    if fit.names[0] != "thrust":
        return []
    factor, error = 1.0 - float(fit.estimates[0]), float(fit.standard_errors[0])
    if not (np.isfinite(error) and fit.vif[0] <= INFLATION):
        return []
    if -RATIOS[0] - ERRORS * error <= factor <= RATIOS[1] + ERRORS * error:
        return []
    words = (
        f"where the logged thrust changes, the force along the path changes by {factor:.3g} +-"
        f" {half_interval(error):.2g} times as much beyond the database's drag: {_cause(factor)}"
    )
    evidence = {"factor": factor, "standard_error": error}
    return [Suspicion("thrust", "size", words, evidence)]


def mass_beside(
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
    step: float,
    moments: list[Share],
) -> list[Suspicion]:
    """Return a factor that level and slope of the normal force and the side force share, and the
    moments do not; a tunnel with lift and side force wrong alike gives the same.

    moments : derivatives that the flight tells well.

    measured, predicted : coefficient -> (n,). step : between samples [s]. Source:
    `docs/method/consistency.md`, section "Against the database".
    """
    if not {"CY", "CZ"} <= measured.keys() or len(moments) < FEWEST_MOMENTS:
        return []
    good = {
        axis: usable[axis] & np.isfinite(measured[axis]) & np.isfinite(predicted[axis])
        for axis in ("CY", "CZ")
    }
    here, there = (float(np.median(v["CZ"][good["CZ"]])) for v in (measured, predicted))
    if here * there <= 0.0 or abs(np.log(here / there)) < (1.0 - SCATTER) * np.log(FACTOR):
        return []
    told = [force_ratio(measured[axis], predicted[axis], good[axis], step) for axis in good]
    clear = [each for each in told if each and each.explained > WELL_EXPLAINED and each.value > 0.0]
    if len(clear) < len(good):
        return []
    side, normal = clear
    level = here / there
    # Noise of the flow angles makes a slope small: the one nearest to the level. Of the side force,
    # which has no level of its own, also the one nearest to one.
    slopes = [(each.value, each.value / each.explained) for each in clear]
    ratios = np.log([level, *(min(max(level, low), high) for low, high in slopes)])
    least = float(np.log(min(max(1.0, slopes[0][0]), slopes[0][1])))
    middle = float(np.median(ratios))
    if (
        abs(middle) < np.log(FACTOR)
        or np.any(np.abs(ratios - middle) > SCATTER * abs(middle))
        or least / middle < SCATTER
        or _of_moments(moments) / middle > SCATTER
    ):
        return []
    factor = float(np.exp(middle))
    words = (
        f"all forces are {factor:.3g} times the database's, the moments are not: a mass"
        f" {100 * abs(factor - 1.0):.0f} % too {'small' if factor < 1.0 else 'large'} would"
        f" look like this. Level of the normal force {level:.3g}, its change"
        f" {normal.value:.3g} +- {half_interval(normal.error):.2g}, side force {side.value:.3g} +-"
        f" {half_interval(side.error):.2g}"
    )
    evidence = {"factor": factor, "level": level, "normal": normal.value, "side": side.value}
    return [Suspicion("mass", POSSIBLE, words, evidence)]


def _of_moments(moments: list[Share]) -> float:
    """The factor of moments (natural logarithm), by rates and controls where they are enough: noise
    of vanes makes the effects of flow angles small."""
    others = [each for each in moments if each.variable not in ("alpha", "beta")]
    chosen = others if len(others) >= FEWEST_MOMENTS else moments
    return float(np.median(np.log([each.ratio for each in chosen])))


def cg_beside(axes: Mapping[str, AxisShares], reference: ReferenceGeometry) -> list[Suspicion]:
    """Return a shift of the CG that explains what pitching and yawing moment have in proportion to
    normal and side force.

    A CG assumed dx ahead of its place adds -dx/c CZ to Cm and dx/b CY to Cn. Rates and controls may
    have any size; alpha and beta, through which the forces act, are the database's.

    Coefficients (n,); the shift in metres. Source: `docs/method/consistency.md`, section "Against
    the database".
    """
    pitch = _per_force(axes, "Cm", "CZ", "alpha", -reference.chord)
    yaw = _per_force(axes, "Cn", "CY", "beta", reference.span)
    if pitch is None or yaw is None:
        return []
    (here, error), (there, other) = pitch, yaw
    shift = 0.5 * (here + there)
    margin = ERRORS * float(np.hypot(error, other))
    if (
        margin > abs(shift)  # the two are not told well enough to agree
        or min(abs(here), abs(there)) < SHIFT * reference.chord
        or abs(here) < ERRORS * error
        or abs(there) < ERRORS * other
        or abs(here - there) > SCATTER * abs(shift)
    ):
        return []
    words = (
        "Cm and Cn differ from the database in proportion to normal and side force. A CG assumed"
        f" {abs(shift):.3g} m ({abs(shift) / reference.chord:.2g} chords) too far"
        f" {'forward' if shift > 0.0 else 'aft'} would look like this: {here:.3g} +-"
        f" {half_interval(error):.2g} m by Cm, {there:.3g} +- {half_interval(other):.2g} m by Cn"
    )
    return [Suspicion("cg_x", POSSIBLE, words, {"shift": shift, "pitch": here, "yaw": there})]


def vane_beside(
    axes: Mapping[str, AxisShares], fits: Mapping[str, Regression], known: list[Share]
) -> list[Suspicion]:
    """Return a factor that the effects of alpha on normal force and pitching moment share, and
    those of rates and controls do not: the scale of a vane, or its upwash. A wing and a tail that
    are wrong alike look the same.

    known : derivatives that the flight tells well. Noise of alpha makes its effects small, to no
    less than their part of what is left beside them (Frisch, 1934). Source:
    `docs/method/consistency.md`, section "Against the database".
    """
    both = [s for s in known if s.variable == "alpha" and s.axis in ("CZ", "Cm")]
    moments = [s for s in known if s.axis in MOMENT_AXES and s.variable not in ("alpha", "beta")]
    if len(both) < 2 or len(moments) < FEWEST_MOMENTS:
        return []
    ratios = []
    for share in both:
        view = axes[share.axis]
        own = share.ratio**2 * float(np.var(view.parts["alpha"][view.where])) / share.vif
        part = own / (own + float(np.var(fits[share.axis].residual)))
        ratios.append(max(share.ratio, min(share.ratio / part, 1.0)))  # the nearest to one
    logarithms = np.log(ratios)
    errors = np.array([share.error / share.ratio for share in both])
    middle = float(np.mean(logarithms))
    if (
        np.any(np.abs(logarithms) < np.maximum(np.log(FACTOR), ERRORS * errors))
        or np.any(np.abs(logarithms - middle) > SCATTER * abs(middle))
        or abs(_of_moments(moments)) > SCATTER * abs(middle)
    ):
        return []
    told = " and ".join(
        f"{share.ratio:.3g} +- {half_interval(share.error):.2g} times its {share.axis}"
        for share in both
    )
    side = [s.ratio for s in known if (s.axis, s.variable) == ("CY", "beta")]
    other = any(abs(np.log(each)) < SCATTER * abs(middle) for each in side)
    factor = float(np.exp(-np.mean(np.log([share.ratio for share in both]))))
    words = (
        f"alpha gives {told} of the database; rates and controls give theirs. An alpha that changes"
        f" {factor:.3g} times as much as it should would look like this. [air_data] upwash is"
        f" missing or inverted, or the vane's scale is another{'' if other else ', or the mass'}"
    )
    return [Suspicion("alpha", POSSIBLE, words, {"factor": factor})]


def _per_force(
    axes: Mapping[str, AxisShares], moment: str, force: str, angle: str, length: float
) -> tuple[float, float] | None:
    """Return what a moment has beyond the database per force, times `length` [m], with its standard
    error; None where the flight does not tell."""
    if not {moment, force} <= axes.keys():
        return None
    view = axes[moment]
    where = view.where & axes[force].where
    columns = {name: part for name, part in view.parts.items() if name != angle}
    columns[force] = axes[force].measured
    rest = view.measured - sum(view.parts.values())
    matrix = np.column_stack([values[where] for values in columns.values()])
    try:
        fit = least_squares(matrix, rest[where], tuple(columns))
    except ValueError:
        return None
    error = abs(length) * float(fit.standard_errors[-1])
    if not np.isfinite(error) or fit.vif[-1] > INFLATION:
        return None
    return length * float(fit.estimates[-1]), error
