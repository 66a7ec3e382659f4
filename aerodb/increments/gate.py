"""The promotion gate: decide whether a version may become ``released``.

All checks are always made, so that a refusal lists everything that is wrong. The gate only judges
what it is given: reading from stores and recording the verdict belong to its callers.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np

from aerodb.increments.held_out import UNCHANGED, pooled, validated
from aerodb.tables import AeroDatabase, CheckCase, failed_check_cases, new_sign_changes

#: Fraction of an error below which a change is rounding.
_ROUNDING: Final = 1e-9
#: At most so many check values, or angles, are listed individually.
_LISTED: Final = 4
#: Most findings that a note names.
_NAMED: Final = 2
#: Under this word a person accepts an import whose file fails its own check cases.
FILE_CHECKS: Final = "file_checks"
#: Under this word a person accepts an import with what no aircraft has.
CONTENT: Final = "content"


#: Verdicts of findings that leave open what it is, in words.
_OPEN: Final = {
    "suspected": "only suspected",
    "alias_group": "only suspected, as one of several effects that these flights cannot tell apart",
    "ambiguous_sensor": "undecided between an effect and an error of a sensor",
}


@dataclass(frozen=True)
class Standing:
    """A version, and its place in its line of versions.

    Parameters
    ----------
    label, parent : labels of the version and of its parent (empty: none).
    released : label of the released version, empty while there is none.
    below_released : whether the released version is among the ancestors.
    stale : reasons why the version is out of date; empty where it is not.
    stored_sha256, content_sha256 : hash stored with it, and hash of the content as read now.
    """

    label: str
    parent: str
    released: str
    below_released: bool
    stale: tuple[str, ...]
    stored_sha256: str
    content_sha256: str


#: Bounds of a measure.
AT_MOST: Final = "at most"
AT_LEAST: Final = "at least"
BELOW: Final = "below"


@dataclass(frozen=True)
class Measure:
    """A number that a check looks at: `of` what, its value, the `bound` and the limit that it is
    held to (None: it is only reported), and where it fell from, in `unit` (empty: a count, or
    dimensionless)."""

    of: str
    value: float
    limit: float | None = None
    bound: str = AT_MOST
    before: float | None = None
    unit: str = ""


@dataclass(frozen=True)
class GateCheck:
    """One check: its name, and the reasons why it failed; passed where there are none.

    label : its name in one or two words. measures : the numbers that it looks at. acceptable :
    under what names a person may accept the reasons; empty where nobody can. not_judged : why it
    does not apply; empty where it does.
    """

    name: str
    reasons: tuple[str, ...]
    label: str
    measures: tuple[Measure, ...] = ()
    acceptable: tuple[str, ...] = ()
    not_judged: str = ""

    @property
    def passed(self) -> bool:
        """Whether it has no reason to refuse."""
        return not self.reasons


@dataclass(frozen=True)
class GateVerdict:
    """The results of all checks; passed where every check passed."""

    checks: tuple[GateCheck, ...]

    @property
    def passed(self) -> bool:
        """Whether no check has a reason to refuse (docs/method/updates.md, section Gate)."""
        return all(check.passed for check in self.checks)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons of all checks to refuse, as sentences; see `GateCheck.reasons`."""
        return tuple(reason for check in self.checks for reason in check.reasons)


def judge_release(
    standing: Standing,
    baseline: AeroDatabase,
    candidate: AeroDatabase,
    check_cases: Sequence[CheckCase],
    axes: Mapping[str, Mapping[str, Any]],
    within_flights: bool = False,
    cross_validated: bool = False,
) -> GateVerdict:
    """Judge whether `candidate` may replace `baseline`, the database that is released now.

    Parameters
    ----------
    standing : the version and its place in the line.
    check_cases : those stored with the candidate.
    axes : from the version's report, axis -> errors before and after (`aerodb.report.document`).
    within_flights : whether these errors are those of parts of the flights that identified, which
        show nothing of another flight.
    cross_validated : whether they are those of each flight left out in turn: the check is then not
        called one of held-out flights.
    """
    error = "error beyond the noise floor of each flight left out in turn falls (not held out)"
    return GateVerdict(
        (
            GateCheck("parent is the released version", _parent(standing), "parent"),
            _not_stale(standing),
            GateCheck("content as stored", _content(standing), "content"),
            _check_cases(candidate, check_cases),
            GateCheck(
                error if cross_validated else "error beyond the noise floor falls",
                _excess(axes, within_flights),
                "left-out error" if cross_validated else "held-out error",
                () if within_flights else _excess_measures(axes),
            ),
            _repeatability(axes),
            _signs(baseline, candidate),
        )
    )


def notes_on_release(report: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what a person should know besides the verdict: what was not held out, and what is only
    suspected.

    report : of the version (docs/reference/contract.md); that of an import has no ``axes``.
    """
    if "wake" in report:
        return ("not held out: a wake is met once",)
    if "axes" not in report:
        return ("not held out: an import comes without flights",)
    notes, axes = [], report["axes"]
    validation = report.get("validation", {})
    if validation.get("kind") == "cross-validated" and not validation.get("within_flights"):
        notes.append(
            "not held out: each flight was predicted from all others in turn (cross-validated), and"
            " all of them identified the version"
        )
    lacking = [axis for axis, entry in axes.items() if entry.get("held_out_rms_after") is None]
    if lacking:
        notes.append(f"not held out: {', '.join(lacking)}; no held-out flight measures them")
    open_ones: dict[tuple[str, str], list[str]] = {}
    for finding in report.get("findings", ()):
        if finding["verdict"] in _OPEN:
            id = finding["hypothesis"]
            added = (
                "added with others of its axis" if id in report.get("added", ()) else "not added"
            )
            if id in report.get("asked_for", ()):
                added = "added because you asked for it"
            open_ones.setdefault((_OPEN[finding["verdict"]], added), []).append(id)
    for (what, added), ids in open_ones.items():
        more = [f"{len(ids) - _NAMED} more"] if len(ids) > _NAMED else []
        notes.append(f"{what}, {added}: {'; '.join([*ids[:_NAMED], *more])}")
    return tuple(notes)


def judge_import(
    standing: Standing,
    imported: AeroDatabase,
    check_cases: Sequence[CheckCase],
    file_checks: Mapping[str, Any] | None,
    accepted: Collection[str] = (),
    unusual: Sequence[str] = (),
) -> GateVerdict:
    """Judge whether an imported database may become ``released``: as the first one, or in place of
    another import from which nothing was flown yet, or whose successors were rolled back.

    check_cases : those stored with the version. file_checks : what came of those of its file
    (`aerodb.exchange.check_file`, as JSON); None where it was imported before they were looked at.
    accepted : what a person accepts, with a reason: `FILE_CHECKS` that fail, and `CONTENT` that no
    aircraft has. unusual : sentences on the latter (`aerodb.tables.unusual_content`).
    """
    found = file_checks or {}
    reasons = tuple(
        f"{found['failed']} numbers of the file's own check cases differ: {first}"
        f" (if its tables are right: --accept {FILE_CHECKS}, and the --reason)"
        for first in found.get("failures", ())[:1]
        if FILE_CHECKS not in accepted
    )
    return GateVerdict(
        (
            _not_stale(standing),
            GateCheck("content as stored", _content(standing), "content"),
            _check_cases(imported, check_cases),
            GateCheck(
                "the file's own check cases",
                reasons,
                "file's cases",
                (Measure("numbers that differ", found.get("failed", 0), 0 if reasons else None),),
                (FILE_CHECKS,) if reasons else (),
            ),
            GateCheck(
                "it holds nothing that no aircraft has",
                tuple(
                    f"{sentence} (if it is right: --accept {CONTENT}, and the --reason)"
                    for sentence in unusual
                    if CONTENT not in accepted
                ),
                "content",
                (Measure("unusual properties", len(unusual), None if CONTENT in accepted else 0),),
                (CONTENT,) if unusual and CONTENT not in accepted else (),
            )
            if not imported.line
            else _of_aerodynamics(imported, "it holds nothing that no aircraft has", "content"),
        )
    )


def _not_stale(standing: Standing) -> GateCheck:
    return GateCheck(
        "not stale",
        standing.stale,
        "not stale",
        (Measure("reasons to rebuild", len(standing.stale), 0),),
    )


def _parent(standing: Standing) -> tuple[str, ...]:
    if standing.parent == standing.released:
        return ()
    if standing.below_released:
        first = standing.parent
        return (
            (
                f"its parent {first} is not released, so it was not validated against"
                f" {standing.released}; promote {first} first"
            ),
        )
    made_on = f"was made on {standing.parent}" if standing.parent else "has no parent"
    what = (
        f"{standing.label} {made_on}, but {standing.released} is released: promoting it would"
        " silently undo that release"
    )
    if not standing.parent:
        what += (
            "; to replace a released import, first go back to it: aerodb version rollback. A"
            " database of another flight condition is imported for a vehicle of its own: aerodb"
            " vehicle add, then aerodb database import --vehicle"
        )
    return (what,)


def _content(standing: Standing) -> tuple[str, ...]:
    if standing.stored_sha256 == standing.content_sha256:
        return ()
    return (
        (
            f"its numbers have the hash {standing.content_sha256[:12]}, but the stored hash is"
            f" {standing.stored_sha256[:12]}"
        ),
    )


def _check_cases(candidate: AeroDatabase, cases: Sequence[CheckCase]) -> GateCheck:
    if not cases:
        reasons: tuple[str, ...] = (
            "it has no check cases: create the version again, they are written with it",
        )
        cases_found = (Measure("cases", 0, 1, AT_LEAST),)
        return GateCheck("check cases", reasons, "check cases", cases_found)
    failed = failed_check_cases(candidate, cases)
    more = (
        (f"and {len(failed) - _LISTED} more check values differ",) if len(failed) > _LISTED else ()
    )
    return GateCheck(
        "check cases",
        (*failed[:_LISTED], *more),
        "check cases",
        (Measure("cases", len(cases)), Measure("values that differ", len(failed), 0)),
    )


def _excess_measures(axes: Mapping[str, Mapping[str, Any]]) -> tuple[Measure, ...]:
    """Errors beyond the noise floor, pooled as `_excess` judges them and per axis."""
    entries = validated(axes)
    if not entries:
        return ()
    before, after = pooled(entries, "excess_before"), pooled(entries, "excess_after")
    whole = Measure("all axes", after, before, BELOW, before, "noise floors")
    single = (
        Measure(axis, entry["excess_after"], before=entry["excess_before"])
        for axis, entry in entries.items()
    )
    return (whole, *single)


def _excess(axes: Mapping[str, Mapping[str, Any]], within_flights: bool) -> tuple[str, ...]:
    """Return whether the error beyond the noise floor falls: pooled over the body axes in units of
    each axis's floor, and on one of them at least by more than the fraction `UNCHANGED`."""
    entries = validated(axes)
    if not entries:
        return ("not held out: no flight was, so nothing shows that the error falls",)
    if within_flights:
        return (
            (
                "not held out: only parts of the flights that identified it were predicted from the"
                " rest; fly at least one more"
            ),
        )
    before = pooled(entries, "excess_before")
    after = pooled(entries, "excess_after")
    if after < before * (1.0 - _ROUNDING):
        if any(
            entry["excess_after"] < (1.0 - UNCHANGED) * entry["excess_before"]
            for entry in entries.values()
        ):
            return ()
        return (
            "on no axis does the error beyond the noise floor fall on held-out flights by"
            f" {UNCHANGED:.0%}",
        )
    grown = ", ".join(
        f"{axis} {entry['excess_before']:.3g} to {entry['excess_after']:.3g}"
        for axis, entry in entries.items()
        if entry["excess_after"] >= entry["excess_before"]
    )
    return (
        (
            f"the error beyond the noise floor on held-out flights goes from {before:.4g} to"
            f" {after:.4g} noise floors ({grown})"
        ),
    )


def _repeatability(axes: Mapping[str, Mapping[str, Any]]) -> GateCheck:
    """Axes that became worse on held-out flights by more than flights differ among themselves
    (`aerodb.increments.validation.repeatability`); a force along x or z only where lift or drag did
    (`worse_axes`)."""
    reasons: dict[str, str] = {}
    measures = []
    for axis, entry in axes.items():
        before, after = entry["held_out_rms_before"], entry["held_out_rms_after"]
        if before is None or after is None:
            continue
        if "repeatability" not in entry:
            reasons[axis] = (
                f"{axis}: its report does not state how much flights differ among themselves:"
                " create the version again"
            )
            continue
        allowed_growth = max(entry["repeatability"], _ROUNDING * before)
        measures.append(Measure(axis, after - before, allowed_growth))
        if after - before > allowed_growth:
            allowed = f"flights differ by {entry['repeatability']:.3g} among themselves"
            reasons[axis] = (
                f"{axis} is worse on held-out flights: {before:.4g} to {after:.4g} rms, {allowed}"
            )
    judged = {measure.of for measure in measures}
    if {"C_lift", "C_drag"} <= judged and not {"C_lift", "C_drag"} & reasons.keys():
        beside = {"CX", "CZ"} & reasons.keys()
        reasons = {axis: why for axis, why in reasons.items() if axis not in beside}
        measures = [measure for measure in measures if measure.of not in beside]
    name = "no axis worse than its repeatability"
    return GateCheck(name, tuple(reasons.values()), "repeatability", tuple(measures))


def _of_aerodynamics(database: AeroDatabase, name: str, label: str) -> GateCheck:
    """A check that does not apply to what is no vehicle."""
    what = {"friction": "legs", "wake": "a wake"}[database.line]
    return GateCheck(name, (), label, not_judged=f"does not apply: {what} alone")


def _signs(baseline: AeroDatabase, candidate: AeroDatabase) -> GateCheck:
    name, label = "no new sign change outside the data", "sign changes"
    if candidate.line:
        return _of_aerodynamics(candidate, name, label)
    reasons = sign_reasons(baseline, candidate)
    return GateCheck(
        name,
        reasons,
        label,
        (Measure("slopes with a new sign change", len(reasons), 0),),
    )


@lru_cache(maxsize=4)
def sign_reasons(baseline: AeroDatabase, candidate: AeroDatabase) -> tuple[str, ...]:
    """Return a sentence per quantity on new sign changes of dC_lift/dalpha and dCm/dalpha [1/rad]
    outside the data, with their alphas [deg]; the gate refuses with it; empty where there are
    none."""
    changes = new_sign_changes(baseline, candidate)
    sentences = []
    for quantity in dict.fromkeys(change.quantity for change in changes):
        of_quantity = [change for change in changes if change.quantity == quantity]
        alphas = sorted({round(float(np.rad2deg(change.alpha)), 1) for change in of_quantity})
        shown = ", ".join(f"{alpha:.1f}" for alpha in alphas[:_LISTED]) + (
            ", ..." if len(alphas) > _LISTED else ""
        )
        first = "".join(f", {name} = {value:.4g}" for name, value in of_quantity[0].at.items())
        sentences.append(
            f"new sign change of d{quantity}/dalpha outside the data at alpha = {shown} deg{first}"
        )
    return tuple(sentences)
