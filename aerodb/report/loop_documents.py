"""The JSON of a closed loop: findings, reasons, additions and validation.

See docs/reference/contract.md, "JSON".
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

from aerodb.increments import AxisValidation, Beyond, HoldOut
from aerodb.loop import SensorRival, StallWindow, UnexplainedLevel
from aerodb.nomenclature import in_order, is_hinge_axis
from aerodb.remarks import REFUSED, Remark, said
from aerodb.report.document import axis_document, beyond_document, opening, remark_documents
from aerodb.report.glossary import capital, hypothesis_words, listed
from aerodb.report.levels import followed, likely, to_declare
from aerodb.report.numbers import for_people
from aerodb.support import TWO_SIDED
from aerodb.tracing import Finding, FlightDependence, Traced, UnexplainedResidual
from aerodb.units import SI

#: An error of this many noise floors, each flight's constant apart, is no matter of noise as
#: declared.
_FAR_ABOVE_FLOOR: Final = 3.0


def loop_document(
    *,
    vehicle: str,
    baseline: str,
    hold_out: HoldOut,
    excluded: Sequence[tuple[str, str]],
    looks: Mapping[str, int],
    library: str,
    rounds: int,
    traced: Traced,
    findings: Sequence[Finding],
    added: Sequence[Finding],
    left: Sequence[UnexplainedResidual],
    proof: Sequence[AxisValidation],
    remarks: Sequence[str],
    within_flights: bool = False,
    between: Sequence[FlightDependence] = (),
    asked_for: Sequence[Finding] = (),
    not_added: Mapping[str, str] | None = None,
    without_gain: Collection[str] = (),
    axis_models: Sequence[Mapping[str, Any]] = (),
    beyond: Sequence[Beyond] = (),
    stalls: Sequence[StallWindow] = (),
    levels: Sequence[UnexplainedLevel] = (),
) -> dict[str, Any]:
    """Make the document of a closed loop, in SI units (docs/reference/contract.md, section JSON).

    findings : of all rounds. added : those that entered the candidate; asked_for : those of them
    that did because the user asked; not_added : what the user asked for in vain, name -> why;
    without_gain : ids of what was tried and lowers no error of other flights.
    traced : the last round, which found nothing more to add. left : the unnamed remainder per axis.
    between : what changes with the conditions of the flights. within_flights : whether parts of
    flights were predicted from the rest. axis_models : documents of the increment models that
    entered as a whole. levels : constants that stay unexplained. beyond : flights outside the
    envelope. stalls : the stalls of flights, each predicted by the others. ``candidate`` is left
    None: who stores the version fills it in.
    """
    by_axis: dict[str, list[Finding]] = {}
    for finding in added:
        for axis in finding.axis:
            by_axis.setdefault(axis, []).append(finding)
    standing = {finding.hypothesis for finding in findings}
    head = opening(vehicle, baseline, hold_out, excluded, looks)
    if within_flights:
        head["validation"]["within_flights"] = True
    return {
        **head,
        "library": {"sha256": library, "rounds": rounds},
        "axes": {entry.axis: axis_document(entry) for entry in proof},
        "beyond": [beyond_document(entry) for entry in beyond],
        "stalls": [
            {**asdict(entry), "series": {k: list(v) for k, v in entry.series.items()}}
            for entry in stalls
        ],
        "levels": [asdict(level) for level in levels],
        "added": [finding.hypothesis for finding in added],
        "asked_for": [finding.hypothesis for finding in asked_for],
        "without_gain": sorted(without_gain),
        "not_added": [{"asked": name, "because": why} for name, why in (not_added or {}).items()],
        "axis_models": list(axis_models),
        "increments": [
            {"axis": axis, "terms": [_term(finding) for finding in members]}
            for axis, members in by_axis.items()
        ],
        "findings": [
            *(finding.document() for finding in findings),
            *(_unnamed(entry) for entry in left if entry.found),
        ],
        "not_found": [
            item.document() for item in traced.not_found if item.hypothesis not in standing
        ],
        "between_flights": [entry.document() for entry in between],
        "next_flight": [*traced.next_flight, *(entry.settled_by for entry in between)],
        **remark_documents(
            map(
                said,
                (
                    *remarks,
                    *map(_of_level, levels),
                    *traced.notes,
                    *_without_a_name(proof, findings, left, between),
                ),
            )
        ),
    }


def stall_remarks(stalls: Sequence[StallWindow], labels: Mapping[str, str]) -> list[str]:
    """Return a remark on each flight's stall, predicted by what the other flights agree with: times
    [s], rms errors [-], band [Hz]; of `StallWindow`.

    labels : flight (id) -> its name.
    """
    return [
        f"The stall of {labels.get(entry.flight, entry.flight[:12])} ({entry.start:.1f} to"
        f" {entry.end:.1f} s, below {entry.band:.2g} Hz), predicted by the others that stall,"
        " errs by "
        + ", ".join(
            f"{entry.held[axis]:.2g} in {axis} ({before:.2g} with the baseline,"
            f" {entry.extrapolated[axis]:.2g} with slopes extrapolated)"
            for axis, before in entry.before.items()
        )
        + "."
        for entry in stalls
    ]


def rival_remarks(rivals: Sequence[SensorRival]) -> list[Remark]:
    """Return a remark (`REFUSED`) on each error of a sensor that explains what declared increments
    change; shares are dimensionless."""
    return [
        Remark(
            REFUSED,
            (rival.hypothesis,),
            {axis: (share, "1") for axis, share in rival.shares.items()},
            f"{rival.hypothesis} may be in what was declared: {rival.because}, by"
            f" {_size(rival.value, rival.unit)}. Its effect is "
            + ", ".join(
                f"{share:.0%} of the change on {axis}" for axis, share in rival.shares.items()
            )
            + ". Mend it, or state under [measured] of the vehicle file how well it is known;"
            f" or promote with --accept {rival.hypothesis} (all of them: --accept sensors)",
        )
        for rival in rivals
    ]


def _size(value: float, unit: str) -> str:
    """The size of an error (SI) as people write it."""
    factor, shown = (100.0, "%") if unit == "1" else for_people(unit, SI)
    return f"{factor * value:.2g} {shown}"


def _of_level(level: UnexplainedLevel) -> str:
    """The remark on a constant that nothing explains, or on constants that follow a condition."""
    if level.conditions:
        entry = asdict(level)
        return (
            f"{capital(followed(entry))}, over {len(level.conditions[0].levels)} flights. This is"
            f" {100 * level.share:.0f} % of its mean square error. {likely(entry)} `aerodb update`"
            f" estimates it from a model file with {to_declare([entry])}."
        )
    what = (
        f"{level.axis}: a constant of {level.constant:.2g} stays unexplained,"
        f" {100 * level.share:.0f} % of its mean square error."
    )
    if not level.rivals:
        return f"{what} No believable error of a sensor leaves it: see its zero term."
    needed = [
        f"{hypothesis_words(rival.hypothesis)} ({_size(rival.value, rival.unit)})"
        for rival in level.rivals
    ]
    varies = [hypothesis_words(rival.hypothesis) for rival in level.rivals if rival.varies]
    also = (
        f" Of these, what varies within the flights agrees with {listed(varies)}." if varies else ""
    )
    return f"{what} The zero term may be wrong, or one of these: {listed(needed)}.{also}"


def _without_a_name(
    proof: Sequence[AxisValidation],
    findings: Sequence[Finding],
    left: Sequence[UnexplainedResidual],
    between: Sequence[FlightDependence],
) -> list[str]:
    """A remark on each axis whose error stays far above the noise although nothing is said of
    it."""
    said = {axis for finding in findings for axis in finding.axis}
    said |= {entry.axis for entry in left if entry.found}
    said |= {axis for entry in between for axis in entry.hypothesis.axes}
    remarks = []
    for entry in proof:
        error = entry.held_out_shape_after
        if error is None or entry.axis in said or not in_order([entry.axis]):
            continue
        if not error > _FAR_ABOVE_FLOOR * entry.noise_floor > 0.0:
            continue
        if is_hinge_axis(entry.axis):
            remarks.append(
                f"{entry.axis} stays at {error / entry.noise_floor:.0f} times its noise floor. A"
                " closed loop seeks no effect on hinge moments. Declare an increment on it in a"
                " model file: aerodb update --model FILE."
            )
        else:
            remarks.append(
                f"{entry.axis} stays at {error / entry.noise_floor:.0f} times its noise floor, each"
                " flight's constant apart. Nothing in these flights names the reason. More flights"
                " at other Mach numbers, dynamic pressures and loadings may. Or the sensors are"
                " noisier than declared."
            )
    return remarks


def _term(finding: Finding) -> dict[str, Any]:
    half = 0.5 * (finding.ci95[1] - finding.ci95[0])
    return {
        "term": finding.parameter,
        "value": finding.value,
        "standard_error": half / TWO_SIDED,
        "ci95": list(finding.ci95),
    }


def _unnamed(entry: UnexplainedResidual) -> dict[str, Any]:
    """Entry of a reproducible residual that fits no template: variables, no parameter or value."""
    return {
        "hypothesis": f"unnamed@{entry.axis}",
        "effect": "unnamed",
        "axis": [entry.axis],
        "subject": "",
        "verdict": "unnamed",
        "parameter": "",
        "unit": "",
        "value": None,
        "ci95": None,
        "p_adjusted": entry.p_adjusted,
        "votes": [],
        "explanation_set": [],
        "because": entry.because,
        "variables": list(entry.variables),
        "share": entry.skill,
    }
