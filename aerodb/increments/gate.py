"""The gate: whether a version may become ``released``. Pure judgement on what it is handed; who
moves names asks it first.

Every check is made, so that a refusal says all that is wrong at once. What is read from stores, and
how the verdict is recorded, does not belong here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.nomenclature import AXES
from aerodb.tables import AeroDatabase, CheckCase, failures, new_sign_changes

#: An error must fall by more than this share to count as fallen.
_ROUNDING: Final = 1e-9
#: No more check values, or angles, than this are listed one by one.
_LISTED: Final = 4


@dataclass(frozen=True)
class Standing:
    """A version as the gate meets it, and where it stands in its line.

    label, parent : labels of the version and of its parent (empty: none). released : label of the
    released version, empty while there is none. below_released : whether the released version is
    among the ancestors. stale : why it no longer stands. stored_sha256, content_sha256 : hash
    stored with it, and that of the content as it is read now.
    """

    label: str
    parent: str
    released: str
    below_released: bool
    stale: tuple[str, ...]
    stored_sha256: str
    content_sha256: str


@dataclass(frozen=True)
class Check:
    """One check: its name, and why it failed; no reason means that it passed."""

    name: str
    reasons: tuple[str, ...]

    @property
    def passed(self) -> bool:
        return not self.reasons


@dataclass(frozen=True)
class Verdict:
    """All checks of the gate."""

    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        return all(check.passed for check in self.checks)

    @property
    def reasons(self) -> tuple[str, ...]:
        return tuple(reason for check in self.checks for reason in check.reasons)


def judge(
    standing: Standing,
    baseline: AeroDatabase,
    candidate: AeroDatabase,
    check_cases: Sequence[CheckCase],
    axes: Mapping[str, Mapping[str, Any]],
) -> Verdict:
    """Whether `candidate` may be released over `baseline`, the database that is released now.

    axes : the version's own report, axis -> errors before and after (`aerodb.report.document`).
    """
    return Verdict(
        (
            Check("parent is the released version", _parent(standing)),
            Check("not stale", standing.stale),
            Check("content as stored", _content(standing)),
            Check("check cases", _check_cases(candidate, check_cases)),
            Check("excess held-out error falls", _excess(axes)),
            Check("no axis worse than its repeatability", _repeatability(axes)),
            Check("no new sign change outside the data", sign_reasons(baseline, candidate)),
        )
    )


def _parent(standing: Standing) -> tuple[str, ...]:
    if standing.parent == standing.released:
        return ()
    if standing.below_released:
        first = standing.parent
        return (
            (
                f"its parent {first} is not released: nothing proves it against"
                f" {standing.released}; promote {first} first"
            ),
        )
    made_on = f"was made on {standing.parent}" if standing.parent else "has no parent"
    return (
        (
            f"{standing.label} {made_on}, released is {standing.released}: promoting it would"
            " silently undo that release"
        ),
    )


def _content(standing: Standing) -> tuple[str, ...]:
    if standing.stored_sha256 == standing.content_sha256:
        return ()
    return (
        (
            f"its numbers have the hash {standing.content_sha256[:12]}, stored with it is"
            f" {standing.stored_sha256[:12]}"
        ),
    )


def _check_cases(candidate: AeroDatabase, cases: Sequence[CheckCase]) -> tuple[str, ...]:
    if not cases:
        return ("it carries no check cases: make it again, they are written with it",)
    failed = failures(candidate, cases)
    more = (
        (f"and {len(failed) - _LISTED} more check values differ",) if len(failed) > _LISTED else ()
    )
    return (*failed[:_LISTED], *more)


def _excess(axes: Mapping[str, Mapping[str, Any]]) -> tuple[str, ...]:
    """The error beyond the noise floor, pooled over the body axes in units of each axis' floor,
    must fall."""
    proved = {
        axis: axes[axis]
        for axis in AXES
        if axis in axes and axes[axis].get("excess_before") is not None
    }
    if not proved:
        return ("no flight was held out: nothing proves that the error falls",)
    before = _pooled(proved, "excess_before")
    after = _pooled(proved, "excess_after")
    if after < before * (1.0 - _ROUNDING):
        return ()
    grown = ", ".join(
        f"{axis} {entry['excess_before']:.3g} to {entry['excess_after']:.3g}"
        for axis, entry in proved.items()
        if entry["excess_after"] >= entry["excess_before"]
    )
    return (
        (
            f"the excess error on held-out flights goes from {before:.4g} to {after:.4g} noise"
            f" floors ({grown})"
        ),
    )


def _pooled(axes: Mapping[str, Mapping[str, Any]], key: str) -> float:
    """Root mean square over axes, each in units of its noise floor (of its error before, where no
    floor is known)."""
    units = [entry["noise_floor"] or entry["held_out_rms_before"] or 1.0 for entry in axes.values()]
    return float(
        np.sqrt(
            np.mean(
                [(entry[key] / unit) ** 2 for entry, unit in zip(axes.values(), units, strict=True)]
            )
        )
    )


def _repeatability(axes: Mapping[str, Mapping[str, Any]]) -> tuple[str, ...]:
    """An axis may become worse on held-out flights by no more than flights differ among themselves
    (`aerodb.increments.validation.repeatability`)."""
    said = []
    for axis, entry in axes.items():
        before, after = entry["held_out_rms_before"], entry["held_out_rms_after"]
        if before is None or after is None:
            continue
        if "repeatability" not in entry:
            said.append(
                f"{axis}: its report does not say how flights differ among themselves: make the"
                " version again"
            )
        elif after - before > max(entry["repeatability"], _ROUNDING * before):
            allowed = f"flights differ by {entry['repeatability']:.3g} among themselves"
            said.append(
                f"{axis} is worse on held-out flights: {before:.4g} to {after:.4g} rms, {allowed}"
            )
    return tuple(said)


def sign_reasons(baseline: AeroDatabase, candidate: AeroDatabase) -> tuple[str, ...]:
    """Per quantity whose slope changes sign anew outside the data, one sentence that says where;
    empty where none does."""
    changes = new_sign_changes(baseline, candidate)
    said = []
    for quantity in dict.fromkeys(change.quantity for change in changes):
        found = [change for change in changes if change.quantity == quantity]
        alphas = sorted({round(float(np.rad2deg(change.alpha)), 1) for change in found})
        shown = ", ".join(f"{alpha:.1f}" for alpha in alphas[:_LISTED]) + (
            ", ..." if len(alphas) > _LISTED else ""
        )
        first = "".join(f", {name} = {value:.4g}" for name, value in found[0].at.items())
        said.append(
            f"new sign change of d{quantity}/dalpha outside the data at alpha = {shown} deg{first}"
        )
    return tuple(said)
