"""Spectrum of the turbulence that a stored flight met."""

from typing import Any, Final

import numpy as np

from aerodb.consistency import air_velocity
from aerodb.errors import InputError
from aerodb.estimation import Interval, gust_spectrum
from aerodb.physics import FORMS, Form, quaternion_from_euler, to_body
from aerodb.signals import bridge
from aerodb.tasks.steps.consistency import load_consistent, unmeasured_angles
from aerodb.tasks.workspace_access import access_workspace

#: Frequency [Hz] up to which gusts are looked at: above it, delays of vanes and of the velocity
#: over the earth, and the bending of the aircraft, are larger than the gusts.
HIGHEST: Final = 2.0
#: Share of the samples that must be usable: the others are bridged.
_COMPLETE: Final = 0.95


def turbulence(
    flight: str,
    *,
    workspace: str,
    run: str,
    form: Form = "dryden",
    since: float | None = None,
    until: float | None = None,
    highest: float = HIGHEST,
) -> dict[str, Any]:
    """Intensity and scale of the gusts u, v, w that a flight (its id) met, with 95 % limits.

    form : of the spectrum. since, until : stretch [s] from the first sample. highest : [Hz].

    Returns a document: form, speed [m/s], duration [s], highest [Hz], wind (mean velocity of the
    air, north, east, down) [m/s], components (name, intensity and scale with value, low and high,
    of which a null limit is open and value is null where both are, noise [m/s], likelihood_gain:
    over the other form), not_measured, notes.
    """
    if form not in FORMS:
        raise InputError(f"unknown form '{form}'", "--form", " or ".join(FORMS))
    if not highest > 0.0:
        raise InputError(f"{highest:g} Hz", "--highest", "a frequency above zero")
    access = access_workspace(workspace)
    row = access.catalogue.flight(flight)
    where = f"flight {row.label}"
    consistent = load_consistent(access, row, run)
    flown = consistent.flight
    elapsed = flown.time - flown.time[0]
    inside = (elapsed >= (since or 0.0)) & (elapsed <= (np.inf if until is None else until))
    moved = air_velocity(flown)[:, inside]
    good = np.isfinite(moved).all(axis=0)
    if not good.any() or good.mean() < _COMPLETE:
        raise InputError(
            f"{good.mean() if good.size else 0.0:.0%} of the samples are usable",
            where,
            "choose a stretch without gaps: --from, --to",
        )
    moved = np.stack([bridge(each) for each in moved])
    wind = moved.mean(axis=1)
    attitude = quaternion_from_euler(*(flown[name][inside] for name in ("phi", "theta", "psi")))
    gusts = to_body(attitude, moved - wind[:, None])
    speed = float(np.nanmedian(flown["V"][inside]))
    absent = unmeasured_angles(consistent.document) | {
        name for name in ("alpha", "beta") if name not in flown
    }
    other: Form = "von_karman" if form == "dryden" else "dryden"
    components: list[dict[str, Any]] = []
    for name, angle, gust in zip("uvw", ("", "beta", "alpha"), gusts, strict=True):
        if angle in absent:
            continue
        found, beside = (
            gust_spectrum(gust, flown.step, speed, name, each, highest) for each in (form, other)
        )
        gain = found.likelihood - beside.likelihood
        components.append(
            {
                "name": name,
                "intensity": _limits(found.intensity),
                "scale": _limits(found.length),
                "noise": found.noise,
                "likelihood_gain": gain,
            }
        )
    return {
        "form": form,
        "speed": speed,
        "duration": float(elapsed[inside][-1] - elapsed[inside][0]),
        "highest": highest,
        "wind": wind.tolist(),
        "components": components,
        "not_measured": sorted(absent),
        "notes": [
            f"{angle} was not measured: gust {name} is not known"
            for name, angle in (("v", "beta"), ("w", "alpha"))
            if angle in absent
        ]
        + [
            f"gust {each['name']}: this stretch does not tell its intensity from its scale"
            for each in components
            if each["intensity"]["value"] is None
        ],
    }


def _limits(interval: Interval) -> dict[str, float | None]:
    """Limits of the interval, None where open; no value where both are."""
    low, high = (value if 0.0 < value < np.inf else None for value in (interval.low, interval.high))
    known = low is not None or high is not None
    return {"value": interval.value if known else None, "low": low, "high": high}
