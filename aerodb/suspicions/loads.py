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
from aerodb.estimation import least_squares
from aerodb.flight import Flight
from aerodb.physics import GRAVITY
from aerodb.signals import low_passed
from aerodb.support import HALF, MINUTE, SUBSTANTIAL, Array, half_interval
from aerodb.suspicions.derivatives import AxisShares, Share
from aerodb.suspicions.drag import ACCELERATION, ANGLE
from aerodb.suspicions.evidence import ERRORS, FEWEST, INFLATION, SCATTER, WELL_EXPLAINED
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
    accelerometer and angle of attack may err by.

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
    if not (here <= LITTLE * there and there - here >= margin):
        return []
    total = np.asarray(sum(flight[name] for name in lines))
    thrust = float(np.median(total[good] / (flight["qbar"][good] * area)))
    lost = abs(thrust) < NOTHING * there
    factor = np.inf if lost else (thrust + there - here) / thrust
    if lost:
        cause = "no thrust was recorded"
    elif abs(factor / _POUND_FORCE - 1.0) < _NEAR:
        cause = f"the thrust is {factor:.3g} times what is logged (lbf taken for N)"
    elif factor < 0.0:
        cause = "the sign of the thrust is flipped"
    else:
        cause = f"the thrust is {factor:.3g} times what is logged"
    words = (
        f"without the logged thrust the drag coefficient is {here:.3g} (median), and the database"
        f" has {there:.3g}: {cause}, or the database has gear, flaps or brakes out"
    )
    evidence = {"measured": here, "predicted": there, "thrust": thrust}
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
    ratios = np.log([here / there, normal.value, side.value])
    errors = np.array([0.0, normal.error / normal.value, side.error / side.value])
    middle = float(np.median(ratios))
    shared = float(np.median(np.log([each.ratio for each in moments])))
    if (
        abs(middle) < np.log(FACTOR)
        or np.any(np.abs(ratios - middle) > SCATTER * abs(middle) + ERRORS * errors)
        or shared / middle > SCATTER
    ):
        return []
    factor = float(np.exp(middle))
    words = (
        f"all forces are {factor:.3g} times the database's, the moments are not: a mass"
        f" {100 * abs(factor - 1.0):.0f} % too {'small' if factor < 1.0 else 'large'} would"
        f" look like this. Level of the normal force {here / there:.3g}, its change"
        f" {normal.value:.3g} +- {half_interval(normal.error):.2g}, side force {side.value:.3g} +-"
        f" {half_interval(side.error):.2g}"
    )
    evidence = {"factor": factor, "level": here / there, "normal": normal.value, "side": side.value}
    return [Suspicion("mass", POSSIBLE, words, evidence)]


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
