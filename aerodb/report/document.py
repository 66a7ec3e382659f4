"""The JSON of an update: estimates, flights and validation (docs/reference/contract.md, "JSON")."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

from aerodb.coefficients import THRUST_REMEDY
from aerodb.increments import AxisUpdate, AxisValidation, Beyond, Excursion, HoldOut, Update
from aerodb.nomenclature import is_surface
from aerodb.remarks import LEAVES_ENVELOPE, Remark, said, sentences


def update_document(
    *,
    vehicle: str,
    baseline: str,
    hold_out: HoldOut,
    excluded: Sequence[tuple[str, str]],
    looks: Mapping[str, int],
    update: Update,
    proof: Sequence[AxisValidation],
    beyond: Sequence[Beyond] = (),
) -> dict[str, Any]:
    """Make the document of an update.

    looks : held-out flight -> number of versions that it has validated before.

    ``candidate`` is None; whoever stores the version fills it in. Values are dimensionless or per
    SI unit of the term; see docs/reference/contract.md, section JSON.
    """
    return {
        **opening(vehicle, baseline, hold_out, excluded, looks),
        "axes": {entry.axis: axis_document(entry) for entry in proof},
        "beyond": [beyond_document(entry) for entry in beyond],
        "increments": [_increment(entry) for entry in update.axes],
        "findings": [],
        "not_found": [],
        "next_flight": [],
        **remark_documents(map(said, _remarks(update, proof, hold_out))),
    }


def remark_documents(remarks: Iterable[Remark]) -> dict[str, Any]:
    """Return the keys of a document for remarks: their sentences, and each as data, with value and
    unit (docs/reference/contract.md, section JSON)."""
    held = list(remarks)
    return {
        "remarks": sentences(held),
        "remark_data": [{**remark.document(), "text": ""} for remark in held],
    }


def add_remarks(document: dict[str, Any], remarks: Iterable[Remark]) -> None:
    """Add remarks to the document of an update or a closed loop, as `remark_documents` gives them;
    raises KeyError for a document without their keys."""
    for key, entries in remark_documents(remarks).items():
        document[key] += entries


def opening(
    vehicle: str,
    baseline: str,
    hold_out: HoldOut,
    excluded: Sequence[tuple[str, str]],
    looks: Mapping[str, int],
) -> dict[str, Any]:
    """Return the common head of the documents of updates and closed loops: versions and roles of
    flights. See docs/reference/contract.md, section JSON."""
    return {
        "vehicle": vehicle,
        "baseline": baseline,
        "candidate": None,
        "flights": {
            "identified": list(hold_out.identified),
            "held_out": list(hold_out.held_out),
            "excluded": [{"flight": flight, "reason": reason} for flight, reason in excluded],
        },
        "validation": {"kind": hold_out.kind, "looked_at_before": dict(looks)},
    }


def axis_document(entry: AxisValidation) -> dict[str, Any]:
    """Return the errors of one axis before and after, rms of coefficients and dimensionless
    (docs/reference/contract.md, section JSON)."""
    return {
        "rms_before": entry.rms_before,
        "rms_after": entry.rms_after,
        "held_out_rms_before": entry.held_out_rms_before,
        "held_out_rms_after": entry.held_out_rms_after,
        "held_out_without_constant_before": entry.held_out_shape_before,
        "held_out_without_constant_after": entry.held_out_shape_after,
        "excess_before": entry.excess_before,
        "excess_after": entry.excess_after,
        "theil": asdict(entry.theil) if entry.theil is not None else None,
        "noise_floor": entry.noise_floor,
        "repeatability": entry.repeatability,
        "explained": entry.explained,
        "outcome": entry.outcome,
        **({} if entry.unit == "1" else {"unit": entry.unit}),
    }


def beyond_document(entry: Beyond) -> dict[str, Any]:
    """Return both errors of a flight outside the envelope, dimensionless, and its intervals [s]
    (docs/reference/contract.md, section JSON)."""
    return {
        **asdict(entry),
        "excursions": [asdict(each) for each in entry.excursions],
        "intervals": [list(each) for each in entry.intervals],
        "used": "continued" if entry.continued else "held",
    }


#: What a version does beyond an envelope (docs/method/updates.md, section Envelope).
_AS_FADED: Final = "with the correction held at the edge and faded"
_AS_CONTINUED: Final = "with slopes continued and then held"


def beyond_remarks(beyond: Sequence[Beyond], labels: Mapping[str, str]) -> list[Remark]:
    """Return remarks on flights that leave the envelope of what predicts them: where, both errors,
    and which one the version uses. One per flight and axis.

    labels : flight (id) -> its name. Errors are dimensionless, angles in [deg] (`excursion_text`).
    """
    remarks = []
    for entry in beyond:
        name = labels.get(entry.flight, entry.flight[:12])
        ways = [_excursion(each) for each in entry.excursions]
        sentence = (
            f"{name} leaves the flown range on {entry.axis} in {entry.share:.0%} of its samples"
            f" ({'; '.join(ways)}). There the error is {entry.held_outside:.2g} as the version has"
            f" it, {_AS_CONTINUED if entry.continued else _AS_FADED}, and"
            f" {entry.extrapolated_outside:.2g} with its slopes extrapolated; over the whole flight"
            f" {entry.held:.2g} and {entry.extrapolated:.2g}."
        )
        values = {"share": (entry.share, "1")}
        remarks.append(Remark(LEAVES_ENVELOPE, (entry.flight, entry.axis), values, sentence))
    return remarks


def _excursion(each: Excursion) -> str:
    return excursion_text(each.variable, each.flight, each.envelope)


def excursion_text(variable: str, flight: Sequence[float], envelope: Sequence[float]) -> str:
    """Return a variable that leaves its envelope: from and to in the flight, and in the envelope;
    angles in [deg], others in SI units (`Excursion`).

    >>> excursion_text("mach", (0.16, 0.17), (0.2, 0.3))
    'mach 0.16 to 0.17, flown 0.2 to 0.3'
    """
    angle = is_surface(variable) or variable in ("alpha", "beta", "phi", "theta")
    factor, unit = (math.degrees(1.0), " deg") if angle else (1.0, "")
    low, high, first, last = (f"{value * factor:.3g}" for value in (*flight, *envelope))
    return f"{variable} {low} to {high}{unit}, flown {first} to {last}"


def _increment(entry: AxisUpdate) -> dict[str, Any]:
    terms = [
        {
            "term": name,
            "value": float(entry.estimates[k]),
            "standard_error": float(entry.standard_errors[k]),
            "ci95": [
                float(entry.estimates[k] + side * 1.96 * entry.standard_errors[k])
                for side in (-1, 1)
            ],
            "vif": float(entry.vif[k]),
            "at_bound": name in entry.at_bound,
        }
        for k, name in enumerate(entry.names)
    ]
    return {
        "axis": entry.axis,
        "terms": terms,
        "r_squared": entry.r_squared,
        "outputs": dict(entry.outputs),
        "fit_percent": entry.theil.fit_percent,
        "correlation": entry.correlation.tolist(),
        "not_excited": list(entry.not_excited),
        "dependent": {term: list(others) for term, others in entry.dependent.items()},
        "aliases": [list(group) for group in entry.aliases],
    }


def hold_out_remarks(hold_out: HoldOut, within_flights: bool = False) -> list[str]:
    """Return a remark on what the errors after mean, if no flight was held out
    (docs/reference/conventions.md, section Hold-out).

    within_flights : whether parts of flights were predicted from the rest.
    """
    if hold_out.kind == "cross-validated" and within_flights:
        return [
            "The first and last parts of the flights were predicted from the rest (cross-validated"
            " within flights); no flight was held out."
        ]
    return {
        "held-out": [],
        "cross-validated": [
            "Fewer than five flights: each was predicted from the others (cross-validated), none"
            " was held out."
        ],
        "not validated": [
            "No flight was held out: the errors after are those of the flights used for"
            " identification, and prove nothing."
        ],
    }[hold_out.kind]


def left_out_remarks(left_out: Mapping[str, Sequence[str]], labels: Mapping[str, str]) -> list[str]:
    """Remarks on flights of which axes were left out because their thrust is not known, one for
    each set of axes.

    left_out : flight (id) -> axes. labels : flight (id) -> its name.
    """
    flights: dict[tuple[str, ...], list[str]] = {}
    for flight, axes in left_out.items():
        flights.setdefault(tuple(axes), []).append(labels.get(flight, flight[:12]))
    return [
        f"{', '.join(axes)} of {'flight' if len(names) == 1 else 'flights'} {', '.join(names)} were"
        " left out: they contain thrust, which [thrust] of the vehicle file says is logged and"
        f" {'this flight lacks' if len(names) == 1 else 'these flights lack'}; {THRUST_REMEDY}."
        for axes, names in flights.items()
    ]


def _remarks(update: Update, proof: Sequence[AxisValidation], hold_out: HoldOut) -> list[str]:
    """Remarks that a reader must know before trusting the numbers."""
    remarks, axes = [f"{each}." for each in update.reservations], update.axes
    added = update.candidate.increments[len(update.candidate.increments) - len(axes) :]
    remarks += [
        f"{increment.axis}: the increment is {increment.full_note}."
        for increment in added
        if increment.full_note
    ]
    remarks += hold_out_remarks(hold_out)
    declared = {entry.axis for entry in axes}
    for entry in proof:
        if entry.axis in declared and entry.outcome == "not repaired":
            remarks.append(_not_repaired(entry))
    for axis in axes:
        for group in axis.aliases:
            remarks.append(
                f"{axis.axis}: {' and '.join(group)} moved together in these flights and cannot be"
                " told apart (alias group)."
            )
        for term, others in axis.dependent.items():
            remarks.append(
                f"{axis.axis}: {term} was left out: in these flights it is a linear combination of"
                f" {', '.join(others)}, whose estimate holds what both do."
            )
        if axis.not_excited:
            remarks.append(
                f"{axis.axis}: {', '.join(axis.not_excited)} did not move in these flights and was"
                " left out."
            )
        if axis.at_bound:
            remarks.append(
                f"{axis.axis}: {', '.join(axis.at_bound)} ended on a bound of the model file."
            )
    return remarks


def _not_repaired(entry: AxisValidation) -> str:
    """Remark on an axis that is not repaired, with the reason as far as its numbers show it."""
    held_out = entry.held_out_rms_after is not None
    after = entry.held_out_rms_after if entry.held_out_rms_after is not None else entry.rms_after
    share = f"{entry.explained:.0%} of" if entry.explained > 0 else "nothing of"
    left = f"{after:.4g} rms remain, {share} the measured variation about its mean is explained."
    statement = f"{entry.axis} is not repaired by the declared structure: {left}"
    if (
        held_out
        and entry.held_out_shape_after is not None
        and entry.held_out_shape_after < 0.5 * (after or 0.0)
    ):
        return (
            f"{statement} Most of it is a constant in each flight: look at sensor biases and thrust"
            " before the aerodynamics."
        )
    return (
        f"{statement} Either the database has a fault that no declared term describes, or these"
        " flights do not agree."
    )
