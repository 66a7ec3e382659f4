"""The JSON of a closed loop: findings, reasons, additions and validation.

See docs/reference/contract.md, "JSON".
"""

from collections.abc import Mapping, Sequence
from typing import Any

from aerodb.increments import AxisValidation, HoldOut
from aerodb.report.document import axis_document, opening
from aerodb.tracing import Finding, FlightDependence, Traced, UnexplainedResidual


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
) -> dict[str, Any]:
    """Make the document of a closed loop.

    findings : of all rounds. added : those that entered the candidate. traced : the last round,
    which found nothing more to add. left : the unnamed remainder per axis. between : what
    changes with the conditions of the flights. within_flights : whether
    parts of flights were predicted from the rest. ``candidate`` is left
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
        "added": [finding.hypothesis for finding in added],
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
        "remarks": [*remarks, *traced.notes],
    }


def _term(finding: Finding) -> dict[str, Any]:
    half = 0.5 * (finding.ci95[1] - finding.ci95[0])
    return {
        "term": finding.parameter,
        "value": finding.value,
        "standard_error": half / 1.96,
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
