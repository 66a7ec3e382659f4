"""The acid test of a version: its responses on held-out flights, summed up and drawn."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from aerodb.report import FlownStretch, response_report
from aerodb.storage.catalogue import VersionRow
from aerodb.storage.files import read_results
from aerodb.tasks.actors import user
from aerodb.tasks.page_head import head_of_result
from aerodb.tasks.steps.fly import flown_responses
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace

Document = Mapping[str, Any]


def summarise_responses(
    after: Sequence[Document],
    *,
    workspace: str,
    run: str,
    before: Sequence[Document],
    independent: bool,
) -> dict[str, Any]:
    """Sum up the documents of `fly_version` of several flights, for a version and its baseline.

    Returns a document: version, baseline, independent, flights, tolerances, manoeuvres, checks
    (check, manoeuvres, passed, share; and of the baseline), responses (channel, rms error, Theil's
    fit and parts, improved: in how many manoeuvres; and of the baseline), oscillations (of flight,
    version and baseline), failed, not_flown, stabilised, passed, standard (`standard_document`),
    cases (each check of each manoeuvre: what deviated by how much, SI, with feedback, open loop,
    and of the baseline), not_covered (tests of the standard without a case), feedback (largest
    correction [rad], open-loop checks, doubling_time [s]; None where none was closed).
    """
    access = access_workspace(workspace)
    labels = access.catalogue.flight_labels(d["flight"] for d in after)
    return responses_summary(after, before, labels, independent)


def responses_summary(
    after: Sequence[Document],
    before: Sequence[Document],
    labels: Mapping[str, str],
    independent: bool,
) -> dict[str, Any]:
    """Return what `summarise_responses` does, without a store; labels : flight (id) -> its name."""
    stretches = [(d["flight"], s) for d in after for s in d["stretches"]]
    flown = [(flight, s) for flight, s in stretches if "reason" not in s]
    earlier = [s for d in before for s in d["stretches"] if "reason" not in s]
    checks = [
        {
            **_of_check(name, [s for _, s in flown]),
            "before": _of_check(name, earlier) if before else None,
        }
        for name in dict.fromkeys(c["check"] for _, s in flown for c in s["checks"])
    ]
    responses = [
        {
            **_of_response(name, [s for _, s in flown]),
            "improved": _improved(name, after, before),
            "before": _of_response(name, earlier) if before else None,
        }
        for name in dict.fromkeys(r["channel"] for _, s in flown for r in s["responses"])
    ]
    failed = [
        {"flight": flight, "name": labels[flight]}
        | {key: s[key] for key in ("since", "until", "kind")}
        | {"check": check["check"], "share": check["share"]}
        for flight, s in flown
        for check in s["checks"]
        if not check["passed"]
    ]
    return {
        "version": after[0]["version"] if after else None,
        "baseline": before[0]["version"] if before else None,
        "independent": independent,
        "flights": [d["flight"] for d in after],
        "tolerances": after[0]["tolerances"] if after else None,
        "manoeuvres": len(flown),
        "stabilised": sum(bool(s["feedback"]) for _, s in flown),
        "checks": checks,
        "responses": responses,
        "oscillations": _swings(after, before),
        "failed": failed,
        "not_flown": [
            {"flight": flight, "name": labels[flight], "since": s["since"], "until": s["until"]}
            | _why(s.get("what", s["reason"]))
            for flight, s in stretches
            if "reason" in s
        ],
        "passed": bool(checks) and not failed,
        **_qualification(after, before, labels),
    }


def _why(lines: str) -> dict[str, str]:
    """Why a stretch was not flown, in one sentence and by part: what is wrong, and what to do."""
    first, _, rest = lines.partition("\n")
    joined = "; ".join(rest.splitlines())
    return {"reason": "; ".join(filter(None, (first, joined))), "what": first, "remedy": joined}


def _qualification(
    after: Sequence[Document], before: Sequence[Document], labels: Mapping[str, str]
) -> dict[str, Any]:
    """Cases of the qualification table, the tests that no case covers, and what feedback did."""
    standard = after[0].get("standard") if after else None
    earlier = {
        (d["flight"], s["since"], c["check"]): _case_of(s, c)
        for d in before
        for s in d["stretches"]
        for c in s.get("checks", ())
    }
    cases = [
        {"flight": d["flight"], "name": labels[d["flight"]]}
        | {key: s[key] for key in ("since", "until", "kind")}
        | {"condition": s.get("condition"), "check": c["check"], "test": c.get("test", "")}
        | _case_of(s, c)
        | {"before": earlier.get((d["flight"], s["since"], c["check"]))}
        for d in after
        for s in d["stretches"]
        for c in s.get("checks", ())
    ]
    covered = {case["test"] for case in cases}
    tests = standard["tests"] if standard else ()
    return {
        "standard": standard,
        "cases": cases,
        "not_covered": [test for test in tests if test["number"] not in covered],
        "feedback": _feedback(cases, [s for d in after for s in d["stretches"]]),
    }


def _case_of(stretch: Document, check: Document) -> dict[str, Any]:
    """Result of a check of a manoeuvre, and open loop where feedback was closed."""
    known = stretch.get("open_loop")
    alone = [c for c in known["checks"] if c["check"] == check["check"]] if known else []
    keys = ("share", "required", "passed", "bands")
    return {
        **{key: check.get(key) for key in keys},
        "correction": max(stretch["correction"].values(), default=None),
        "open_loop": {key: alone[0].get(key) for key in keys} if alone else None,
    }


def _feedback(cases: Sequence[Document], stretches: Sequence[Document]) -> dict[str, Any] | None:
    """What the feedback of stretches did, and how many checks hold without it."""
    known = [s["open_loop"] for s in stretches if "open_loop" in s]
    if not known:
        return None
    times = [each["doubling_time"] for each in known if each["doubling_time"] is not None]
    alone = [case["open_loop"] for case in cases if case["open_loop"]]
    return {
        "correction": max(
            (max(s["correction"].values()) for s in stretches if s.get("correction")), default=0.0
        ),
        "checks": len(alone),
        "passed": sum(each["passed"] for each in alone),
        "doubling_time": min(times, default=None),
    }


def known_responses(
    access: WorkspaceAccess, version: VersionRow, baseline: str | None, tolerances: str = ""
) -> dict[str, Any] | None:
    """Return the summary (rms in SI units, `summarise_responses`) of how a version last flew its
    held-out flights as wholes, compared with a `baseline` (its id); None where it did not.

    tolerances : name of those that it is judged by; empty: any.
    """
    uses = access.catalogue.version_flights(version.id)
    held = [use.flight for use in uses if use.role == "held_out"]
    after = _newest(access, version.id, held, tolerances)
    if not after:
        return None
    flown = [document["flight"] for document in after]
    before = _newest(access, baseline, flown, after[0]["tolerances"]) if baseline else []
    where = {"workspace": str(access.workspace.root), "run": ""}
    return summarise_responses(
        after, **where, before=before if len(before) == len(after) else [], independent=True
    )


def _newest(
    access: WorkspaceAccess, version: str, flights: Sequence[str], tolerances: str
) -> list[dict[str, Any]]:
    """Return of each flight the newest document with the most manoeuvres flown: a part of a flight
    that somebody flew later says less than the whole."""
    chosen = []
    for flight in flights:
        rows = [row for row in access.catalogue.results_of(flight, "fly") if version in row.inputs]
        paths = [path for row in reversed(rows) if (path := access.path_of(row.key)) is not None]
        documents = [dict(read_results(path, ("time",))[1]["document"]) for path in paths]
        documents = [each for each in documents if tolerances in ("", each["tolerances"])]
        if documents:
            chosen.append(
                max(documents, key=lambda d: sum("reason" not in s for s in d["stretches"]))
            )
    return chosen


def _of_check(name: str, stretches: Sequence[Document]) -> dict[str, Any]:
    found = [c for s in stretches for c in s["checks"] if c["check"] == name]
    return {
        "check": name,
        "manoeuvres": len(found),
        "passed": sum(c["passed"] for c in found),
        "share": float(np.mean([c["share"] for c in found])) if found else None,
    }


def _of_response(channel: str, stretches: Sequence[Document]) -> dict[str, Any]:
    """Root mean square over the manoeuvres, and medians of Theil's statistics."""
    found = [r for s in stretches for r in s["responses"] if r["channel"] == channel]
    if not found:
        return {"channel": channel, "manoeuvres": 0}
    errors = np.array([(r["rms_error"], r["rms_flown"]) for r in found])
    error, size = np.sqrt(np.mean(errors**2, axis=0))
    parts = {
        key: float(np.median([r["theil"][key] for r in found]))
        for key in ("fit_percent", "bias", "variance", "covariance")
    }
    return {
        "channel": channel,
        "manoeuvres": len(found),
        "rms_error": float(error),
        "rms_flown": float(size),
        "theil": parts,
    }


def _swings(after: Sequence[Document], before: Sequence[Document]) -> list[dict[str, Any]]:
    """Return free oscillations of the flights with those of the version and of its baseline."""
    earlier = {
        (d["flight"], s["since"], channel): swing["simulated"]
        for d in before
        for s in d["stretches"]
        for channel, swing in s.get("oscillations", {}).items()
    }
    return [
        {
            "flight": d["flight"],
            "since": s["since"],
            "channel": channel,
            "flown": swing["flown"],
            "version": swing["simulated"],
            "baseline": earlier.get((d["flight"], s["since"], channel)),
        }
        for d in after
        for s in d["stretches"]
        for channel, swing in s.get("oscillations", {}).items()
    ]


def _improved(channel: str, after: Sequence[Document], before: Sequence[Document]) -> int | None:
    """In how many manoeuvres the baseline's error is larger; None without a baseline."""
    if not before:
        return None

    def errors(documents: Sequence[Document]) -> dict[tuple[str, float], float]:
        return {
            (d["flight"], s["since"]): r["rms_error"]
            for d in documents
            for s in d["stretches"]
            for r in s.get("responses", ())
            if r["channel"] == channel
        }

    now, then = errors(after), errors(before)
    return sum(now[key] < then[key] for key in now.keys() & then.keys())


def response_page(
    after: Sequence[Document],
    *,
    workspace: str,
    run: str,
    before: Sequence[Document] = (),
    summary: Document | None = None,
    in_pieces: bool = False,
) -> str | Iterator[str]:
    """Return an HTML page with the responses (n,) of each manoeuvre against the flight, in display
    units as [deg]; in_pieces : as an iterator, which draws each figure when it is asked for."""
    access = access_workspace(workspace)
    labels = [
        access.catalogue.versions_by_id([documents[0]["version"]])[documents[0]["version"]].label
        if documents
        else ""
        for documents in (after, before)
    ]
    result = access.catalogue.result(after[0]["key"]) if after else None
    head = head_of_result(access, result, user()) if result else None
    flown = sum("reason" not in stretch for d in after for stretch in d["stretches"])
    stretches = _stretches(access, after, before)
    page = response_report(labels[0], labels[1], summary, stretches, head, flown)
    return page if in_pieces else "".join(page)


def _stretches(
    access: WorkspaceAccess, after: Sequence[Document], before: Sequence[Document]
) -> Iterator[FlownStretch]:
    """Each stretch that was flown, with its responses; those of a flight are read when the first of
    them is asked for."""
    names = access.catalogue.flight_labels(d["flight"] for d in after)
    earlier = {d["flight"]: d["key"] for d in before}
    for document in after:
        flight = document["flight"]
        others = flown_responses(access, earlier[flight]) if flight in earlier else []
        for number, responses in enumerate(flown_responses(access, document["key"])):
            stretch = document["stretches"][number]
            if "reason" not in stretch:
                beside = others[number] if others else {}
                yield FlownStretch(names[flight], stretch, responses, beside)
