"""Findings: results of updates and closed loops, with reasons and the error on held-out flights."""

from typing import Annotated

from fastapi import APIRouter, Query, Request
from starlette.responses import Response

from aerodb.flows.report import report_flow
from aerodb.flows.web.console import (
    PER_PAGE,
    Limit,
    Vehicle,
    access_of,
    address,
    console_of,
    document,
    page_of,
    report,
)
from aerodb.flows.web.models import Finding, answers
from aerodb.report import decision, error_rows, finding_sentence, meaning
from aerodb.tasks.steps import options_of_result, with_gate
from aerodb.tasks.view import finding_document, findings_page, labels_of, reference_of

router = APIRouter(tags=["findings"])
After = Annotated[
    str, Query(max_length=200, description="End of the previous page, from its header Link.")
]


@router.get("/findings", include_in_schema=False)
def findings_list(request: Request, after: After = "") -> Response:
    """Updates and closed loops, newest first."""
    entries, further = findings_page(access_of(request), PER_PAGE // 2, after)
    following = address("/findings", after=further) if further else ""
    return page_of(
        request, "findings.html", "Findings", findings=entries, after=after, further=following
    )


@router.get(
    "/api/findings",
    summary="Updates and closed loops, newest first",
    responses=answers(list[Finding]),
)
def findings(request: Request, after: After = "", limit: Limit = PER_PAGE // 2) -> Response:
    """Run, vehicle, outcome in one sentence and verdicts of each; `reference` names its
    document."""
    entries, further = findings_page(access_of(request), limit, after)
    return document(
        entries, address("/api/findings", after=further, limit=limit) if further else ""
    )


@router.get("/findings/{reference}", include_in_schema=False)
def finding_page(request: Request, reference: str, vehicle: Vehicle = None) -> Response:
    """One update or closed loop: the finding first, the explanation set, error before and after."""
    access = access_of(request)
    document = finding_document(access, reference, vehicle)
    labels = labels_of(access, document)
    label = labels.get(document["candidate"] or "", "")
    meant = reference_of(access, reference, vehicle)
    judged = with_gate(document, workspace=str(access.workspace.root), run="")
    given = options_of_result(access.catalogue, meant)
    return page_of(
        request,
        "finding.html",
        f"{'Closed loop' if 'library' in document else 'Update'} of {document['vehicle']}",
        found=document,
        decision=decision({**judged, "label": label}, rest="below", given=given),
        errors=error_rows(document),
        labels=labels,
        reference=meant,
        says=[finding_sentence(finding, labels) for finding in document["findings"]],
        meanings=[meaning(finding, document) for finding in document["findings"]],
    )


@router.get("/api/findings/{reference}", summary="One update or closed loop")
def finding(request: Request, reference: str, vehicle: Vehicle = None) -> Response:
    """The document of `aerodb update` or `aerodb close-loop`, by version or by the key of its
    report."""
    return document(finding_document(access_of(request), reference, vehicle))


@router.get("/findings/{reference}/report", include_in_schema=False)
def finding_report(request: Request, reference: str, vehicle: Vehicle = None) -> Response:
    """The report of a finding, as `aerodb report update` writes it."""
    about = reference_of(access_of(request), reference, vehicle)
    return report(
        request,
        console_of(request).run(report_flow, {"kind": "update", "about": about, "in_pieces": True}),
    )
