"""Results of one seeded case, as they are known: names and verdicts exactly, figures to three
digits."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from aerodb.consistency.reconstructed import Estimate
    from aerodb.tracing import Finding

#: Half a unit of the third digit, at worst.
THREE_DIGITS = 5e-3


def told(findings: Iterable["Finding"]) -> list[tuple[str, str, float, float, float]]:
    """Hypothesis, verdict, value and 95 % interval (SI) of each finding."""
    return [(each.hypothesis, each.verdict, each.value, *each.ci95) for each in findings]


def estimated(
    estimates: Iterable["Estimate"], names: Iterable[str]
) -> list[tuple[str, float, float]]:
    """Value and standard error (SI) of the estimates of these parameters."""
    wanted = set(names)
    return [
        (each.parameter.name, float(each.value), float(each.standard_error))
        for each in estimates
        if each.parameter.name in wanted
    ]


def same(found: Sequence[Sequence[object]], known: Sequence[Sequence[object]]) -> bool:
    """Whether rows of words and figures are the known ones. What differs is printed."""
    alike = len(found) == len(known) and all(
        [type(v) for v in row] == [type(v) for v in other]
        and list(row)
        == [pytest.approx(v, rel=THREE_DIGITS) if isinstance(v, float) else v for v in other]
        for row, other in zip(found, known, strict=True)
    )
    if not alike:
        print(
            *(
                tuple(float(f"{v:.3g}") if isinstance(v, float) else v for v in row)
                for row in found
            ),
            sep=",\n",
        )
    return alike
