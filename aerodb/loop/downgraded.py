"""Findings that may be suspected at most: those that earlier looks may have suggested, those whose
addition has lowered no error of other flights, and those that alone make their axis worse.

docs/method/tracing.md, section 13.
"""

from collections.abc import Collection, Iterable
from dataclasses import replace

from aerodb.loop.remarks import TRACED_BEFORE
from aerodb.tracing import Finding, Traced, only_suspected

#: Why a hypothesis that residuals may have suggested is suspected at most.
_LATE = "it joined the list of effects after these flights had been looked at"
#: Why one is that helps no other flight, or only beside what is not admitted.
_NO_GAIN = (
    "its addition lowers the error of other flights by less than 1 %, or by less than the"
    " error without a name on its axis"
)
_WORSE = "it holds only beside others that were not admitted: alone it makes its axis worse"


def only_what_was_frozen(
    traced: Traced, known: frozenset[str] | None
) -> tuple[Traced, tuple[str, ...]]:
    """Downgrade to `suspected` findings that an earlier look at the residuals could have suggested.

    known : ids of the earlier libraries, None if there was none. A hypothesis that joined the
    library after these flights had been traced has no error rate.
    """
    if known is None:
        return traced, ()
    late = [f.hypothesis not in known and f.verdict == "confirmed" for f in traced.findings]
    findings = tuple(
        only_suspected(f, _LATE) if is_late else f
        for f, is_late in zip(traced.findings, late, strict=True)
    )
    return replace(traced, findings=findings), (TRACED_BEFORE,)


def only_with_gain(
    findings: Iterable[Finding], without_gain: Collection[str], withheld: Collection[str] = ()
) -> tuple[Finding, ...]:
    """Downgrade confirmed findings (ids) whose addition lowered no error of other flights, and
    those withheld as their axis would be worse with them alone."""
    because = dict.fromkeys(withheld, _WORSE) | dict.fromkeys(without_gain, _NO_GAIN)
    return tuple(
        only_suspected(each, because[each.hypothesis])
        if each.hypothesis in because and each.verdict == "confirmed"
        else each
        for each in findings
    )
