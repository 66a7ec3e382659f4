"""Problems that a verification finds, and the report that collects them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from aerodb.errors import InputError

#: Kind of problem: an object of the object store that no row of the catalogue names.
ORPHAN_OBJECT: Final = "orphan object"
#: Kind of problem: the chain of events is broken.
CHAIN: Final = "chain"


@dataclass(frozen=True)
class WorkspaceProblem:
    """One inconsistency of a workspace: its kind, what is wrong, where (relative to the workspace),
    and how to repair it."""

    kind: str
    what: str
    where: str
    remedy: str


@dataclass
class VerificationReport:
    """Problems found; number of files, bytes, edges, versions, ... checked, by name; and number of
    files that another process is writing now (`pending`). chain : hash of the newest event's link
    in the chain of events; empty without one."""

    problems: list[WorkspaceProblem] = field(default_factory=list)
    checked: dict[str, int] = field(default_factory=dict)
    pending: int = 0
    chain: str = ""

    def count(self, name: str, number: int = 1) -> None:
        """Add `number` to the count of checked items called `name`."""
        self.checked[name] = self.checked.get(name, 0) + number

    def add(self, kind: str, what: str, where: str, remedy: str) -> None:
        """Add a problem."""
        self.problems.append(WorkspaceProblem(kind, what, where, remedy))


#: Names of what is counted, as `verify --json` has them -> words, where they are others.
_WORDS: Final = {
    "edges": "links between results",
    "linked events": "events in order",
    "moves of names": "releases and rollbacks",
    "sealed catalogues": "catalogues with a checksum",
}


def problem_words(report: VerificationReport) -> list[str]:
    """Each problem of the report as a line of text."""
    return [
        f"{problem.kind}: {problem.where}: {problem.what}; {problem.remedy}"
        for problem in report.problems
    ]


def counted(report: VerificationReport) -> str:
    """What was checked, in words: how many of each."""
    counts = {name: f"{n} {_WORDS.get(name, name)}" for name, n in sorted(report.checked.items())}
    if "bytes" in counts:
        counts["bytes"] = f"{report.checked['bytes'] / 1e6:.1f} MB"
    sums = ", ".join(counts.values())
    return sums + (f"; {report.pending} files are being written" if report.pending else "")


def require_clean(problems: Sequence[WorkspaceProblem], where: str) -> None:
    """Raise InputError that names the first problem, if there is any (`WorkspaceProblem`)."""
    if problems:
        first = problems[0]
        more = f" and {len(problems) - 1} more" if len(problems) > 1 else ""
        raise InputError(f"{first.where}: {first.what}{more}", where, first.remedy)
