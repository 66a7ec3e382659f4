"""The two sides of a control against each other.

An aircraft is its own mirror image: right and left elevon pitch it alike, and roll it by the same
amount in opposite directions. Where the sides move both alike and in opposite directions, each has
an effect of its own in the regression of `equation_error`. Sides whose effects differ by more than
a factor of three are no pair. Sides that move in opposite directions only, such as ailerons, are
not told apart: what is left of their difference is rigging.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from aerodb.conditioning import Suspicion
from aerodb.estimation import Regression
from aerodb.flight import Flight
from aerodb.support import half_interval
from aerodb.suspicions.equation_error import EquationError, equation_errors
from aerodb.suspicions.evidence import CAUSED, ERRORS, EXPLAINED, INFLATION, RATIOS, SWING
from aerodb.suspicions.surfaces import Control
from aerodb.vehicle import Vehicle


def side_suspicions(
    flight: Flight, vehicle: Vehicle, controls: Mapping[str, Control]
) -> tuple[Suspicion, ...]:
    """Return sides of controls whose effect is not that of the other side; one per pair.

    controls : as `by_role` gives them.

    Deflections (n,) are in [rad]. Source: `docs/method/consistency.md`, section "Against the
    vehicle".
    """
    listed = []
    for right, left, apart in _pairs(vehicle, controls):
        both = {right, left}
        if (still := _standing(flight, right, left)) is not None:
            listed.append(still)
        if still is not None or not apart:
            continue
        others = {n: c for n, c in controls.items() if not both & _members(n, c, vehicle)}
        sides = {
            name: Control(((name, 1.0),), "pitch", None, signed=False) for name in (right, left)
        }
        axes = equation_errors(flight, vehicle, {**others, **sides})
        found = (
            said
            for role, mirror in (("pitch", 1.0), ("roll", -1.0))
            if role in axes and (said := _unlike(axes[role], right, left, mirror)) is not None
        )
        listed += list(found)[:1]
    return tuple(listed)


def _pairs(vehicle: Vehicle, controls: Mapping[str, Control]) -> Iterator[tuple[str, str, bool]]:
    """Right and left channel of each control with two sides, and whether the vehicle file declares
    that they move both alike and in opposite directions."""
    kinds: dict[tuple[str, str], set[str]] = {}
    for name, made in vehicle.combinations.items():
        if f"delta_{name}" in controls:
            kinds.setdefault((f"delta_{made.right}", f"delta_{made.left}"), set()).add(made.kind)
    for control in controls.values():
        if len(control.parts) == 2:
            kinds.setdefault((control.parts[0][0], control.parts[1][0]), set())
    yield from ((right, left, len(found) == 2) for (right, left), found in kinds.items())


def _standing(flight: Flight, right: str, left: str) -> Suspicion | None:
    """Return a side that never changes while the other moves; a spoiler rises alone."""
    for still, other in ((right, left), (left, right)):
        moved = float(np.nanstd(flight[other]))
        if "spoiler" not in still and not np.ptp(flight[still]) > 0.0 and moved > SWING:
            words = (
                f"{still} never changes while {other}, its mirror image, does: it was not recorded"
            )
            return Suspicion(still, "stuck", words, {"moved": moved})
    return None


def _members(name: str, control: Control, vehicle: Vehicle) -> set[str]:
    """Channels of which a control is made."""
    combination = vehicle.combinations.get(name.removeprefix("delta_"))
    if combination is not None:
        return {f"delta_{combination.right}", f"delta_{combination.left}"}
    return {part for part, _ in control.parts}


def _unlike(axis: EquationError, right: str, left: str, mirror: float) -> Suspicion | None:
    """Return a side whose effect about one axis is not the other's.

    mirror : what the effect of the left side is multiplied by to be that of the right one.
    """
    fit = axis.fit()
    if fit is None or not {right, left} <= set(fit.names) or fit.r_squared < EXPLAINED:
        return None
    effects = {right: _effect(fit, right), left: _effect(fit, left)}
    strong, weak = sorted(effects, key=lambda name: -abs(effects[name][0]))
    (large, error), (small, other) = effects[strong], effects[weak]
    small *= mirror * float(np.sign(large))
    missing = RATIOS[0] * abs(large) - small
    moved = float(np.std(axis.controls[strong][axis.where]))
    caused = abs(large) * moved / max(float(np.std(axis.moment[axis.where])), 1e-300)
    alike = max(float(fit.vif[fit.names.index(name)]) for name in effects)
    told = missing >= ERRORS * float(np.hypot(RATIOS[0] * error, other))  # nan: not solved
    if not (told and alike <= INFLATION and caused >= CAUSED):
        return None
    words = (
        f"{weak} gives {effects[weak][0]:.3g} +- {half_interval(other):.2g} per rad about the"
        f" {axis.role} axis, its mirror image {strong} {large:.3g} +- {half_interval(error):.2g}."
        " One was not recorded, is in another unit, or is another surface's channel"
    )
    return Suspicion(weak, "unit", words, {"ratio": small / abs(large), "caused": caused})


def _effect(fit: Regression, name: str) -> tuple[float, float]:
    """Effect and standard error of a control."""
    k = fit.names.index(name)
    return float(fit.estimates[k]), float(fit.standard_errors[k])
