"""Mass, inertia, centre of gravity and reference lengths against each other."""

from collections.abc import Mapping

import numpy as np

from aerodb.conditioning import Suspicion
from aerodb.flight import Flight
from aerodb.support import SMALL, Array
from aerodb.suspicions.in_flight import known_masses
from aerodb.vehicle import Reference, Vehicle

#: Share by which a moment of inertia may exceed the sum of the other two: errors of estimates. No
#: body exceeds it: Ixx + Iyy - Izz = 2 integral of z^2 dm.
TRIANGLE = SMALL
#: Least Izz over Ixx + Iyy: aircraft are flat. 56 aircraft of JSBSim have .63 to 1.08, but for two
#: balls, a balloon, a paraglider and three whose inertia no body has.
FLAT = 0.6
#: Radius of gyration in roll over the span: the same aircraft have .10 to .29 (Roskam, Airplane
#: Design V, 1985, appendix B: .10 to .20). Half of it has all mass at the wing tips.
ROLL = (0.07, 0.36)
#: Radii of gyration in pitch and yaw over the larger of span and chord: .10 to .69 of the same
#: aircraft; flying wings have less.
PITCH = (0.04, 0.8)
#: Area over span times chord of one wing. At most 1 for the mean aerodynamic chord (c is the mean
#: of c^2 over that of c). It has the margin of other definitions. Slender deltas have .5.
AREA = (0.4, 1.5)
#: Factor between constant mass properties and logged ones that fuel and loading do not explain.
APART = 2.0
#: Largest distance of the centre of gravity from the moment reference, in chords.
CHORDS = 1.0


def mass_suspicions(flight: Flight, vehicle: Vehicle) -> tuple[Suspicion, ...]:
    """Return mass properties and lengths that no body of this size can have.

    Where mass properties change in flight, their medians are judged.

    Mass [kg], inertia [kg m^2], lengths [m]. Source: `docs/method/consistency.md`, section "Against
    the vehicle". Channels are (n,).
    """
    size = vehicle.reference
    listed = _geometry(size)
    known = known_masses(flight, vehicle)
    at = {name: _median(values) for name, values in known.items()}
    for name in ("mass", "Ixx", "Iyy", "Izz"):
        if name in at and not 0.0 < at[name] < np.inf:
            words = f"{name} is {at[name]:.4g}: it must be positive and finite"
            return (*listed, Suspicion(name, "unit", words, {}))
    logged = _logged(flight, at) if vehicle.mass.source == "constant" else []
    return (*listed, *logged, *_inertia(at), *_radii(at, size), *_centre(at, vehicle))


def _logged(flight: Flight, at: Mapping[str, float]) -> list[Suspicion]:
    """Return mass or inertia of which the log holds another value than the vehicle file."""
    for name in ("mass", "Ixx", "Iyy", "Izz"):
        logged = _median(flight[name]) if name in flight else 0.0
        if logged > 0.0 and not 1.0 / APART < at[name] / logged < APART:
            words = (
                f"{name} is {at[name]:.4g} in the vehicle file and {logged:.4g} in the log: a unit"
                " is another, or the log is another aircraft's"
            )
            return [Suspicion(name, "size", words, {"stated": at[name], "logged": logged})]
    return []


def _median(values: Array) -> float:
    good = values[~np.isnan(values)]
    return float(np.median(good)) if len(good) else float("nan")


def _geometry(size: Reference) -> list[Suspicion]:
    ratio = size.area / (size.span * size.chord)
    if AREA[0] <= ratio <= AREA[1]:
        return []
    words = (
        f"the reference area is {size.area:.4g} m^2, {ratio:.3g} times span ({size.span:.4g} m)"
        f" times chord ({size.chord:.4g} m; possible: {AREA[0]:g} to {AREA[1]:g}). One of"
        " [reference] is wrong (a half span, another unit)"
    )
    return [Suspicion("area", "size", words, {"ratio": ratio})]


def _inertia(at: Mapping[str, float]) -> list[Suspicion]:
    names = ("Ixx", "Iyy", "Izz")
    if not set(names) <= at.keys():
        return []
    for name in names:
        others = [other for other in names if other != name]
        total = sum(at[other] for other in others)
        if at[name] > (1.0 + TRIANGLE) * total:
            words = (
                f"{name} is {at[name]:.4g} kg m^2, more than {' + '.join(others)} ({total:.4g}),"
                " which no body has"
            )
            return [Suspicion(name, "size", words, {"ratio": at[name] / total})]
    flat = at["Izz"] / (at["Ixx"] + at["Iyy"])
    if flat < FLAT:
        words = (
            f"Izz is {at['Izz']:.4g} kg m^2, {flat:.3g} times Ixx + Iyy, and an aircraft, which is"
            f" flat, has {FLAT:g} to 1: one of them is wrong, or in another unit"
        )
        return [Suspicion("Izz", "size", words, {"ratio": flat})]
    product = at.get("Ixz", 0.0)
    if product * product >= at["Ixx"] * at["Izz"]:
        words = f"Ixz is {product:.4g} kg m^2, and its square exceeds Ixx Izz, which no body has"
        return [Suspicion("Ixz", "size", words, {"Ixz": product})]
    return []


def _radii(at: Mapping[str, float], size: Reference) -> list[Suspicion]:
    if "mass" not in at:
        return []
    long = max(size.span, size.chord)
    listed = []
    for name, length, of, (low, high) in (
        ("Ixx", size.span, "span", ROLL),
        ("Iyy", long, "span or chord", PITCH),
        ("Izz", long, "span or chord", PITCH),
    ):
        radius = float(np.sqrt(at[name] / at["mass"])) if name in at else float("nan")
        if np.isfinite(radius) and not low <= radius / length <= high:
            words = (
                f"{name} {at[name]:.4g} kg m^2 and mass {at['mass']:.4g} kg are a radius of"
                f" gyration of {radius:.3g} m, {radius / length:.3g} times the {of}"
                f" ({length:.4g} m; possible: {low:g} to {high:g}): a unit is another"
            )
            listed.append(Suspicion(name, "size", words, {"radius": radius, "length": length}))
    if len(listed) == 3:  # what they share
        words = (
            f"mass {at['mass']:.4g} kg fits none of the moments of inertia: {listed[0].sentence}"
        )
        return [Suspicion("mass", "size", words, listed[0].evidence)]
    return listed


def _centre(at: Mapping[str, float], vehicle: Vehicle) -> list[Suspicion]:
    size, reference = vehicle.reference, vehicle.points.moment_reference
    if reference == "cg":
        return []
    limit = CHORDS * size.chord
    listed = []
    for name, place in zip(("cg_x", "cg_y", "cg_z"), reference, strict=True):
        if name not in at or not abs(at[name] - place) > limit:
            continue
        sign = abs(-at[name] - place) <= limit
        words = (
            f"{name} is {at[name]:.4g} m, {abs(at[name] - place):.3g} m from the moment reference"
            f" ({place:.4g} m), and should be within {limit:.3g} m:"
            f" {'its sign is flipped' if sign else 'unit, datum or sign differ'}"
        )
        listed.append(Suspicion(name, "sign" if sign else "unit", words, {"place": at[name]}))
    return listed
