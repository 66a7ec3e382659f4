"""Where the data of increments end, and what a version does beyond: in words, for figures and
tables of coefficients.

A change that fades beyond the flown range bends a curve as a stall would; whoever reads it must be
told (docs/method/updates.md, section Envelope).
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from aerodb.report.glossary import listed, with_true_signs
from aerodb.report.numbers import display_unit
from aerodb.tables import AeroDatabase, Increment, new_increments
from aerodb.units import UnitSystem


@dataclass(frozen=True)
class Reach:
    """The flown range of a variable, `low` to `high`, in its display unit (empty without
    dimension), and below and above which the change has faded to nothing; `gone` is None where it
    is held instead."""

    variable: str
    low: float
    high: float
    gone: tuple[float, float] | None
    unit: str

    @property
    def brief(self) -> str:
        """The reach in a few words, for a figure."""
        flown = f"flown {self.low:.3g} to {self.high:.3g}"
        if self.gone is not None:
            flown += f", faded out at {self.gone[0]:.3g} and {self.gone[1]:.3g}"
        return with_true_signs(f"{flown} {self.unit}".rstrip())

    @property
    def sentence(self) -> str:
        """The reach as a clause, as terminals write it (`with_true_signs` for pages)."""
        where = f"{self.variable} < {self.low:.3g} or > {self.high:.3g} {self.unit}".rstrip()
        beyond = f"beyond the flown range ({where}) the change"
        if self.gone is None:
            return f"{beyond} is held at its value there"
        low, high = self.gone
        return f"{beyond} fades to nothing at {low:.3g} and {high:.3g} {self.unit}".rstrip()


def reach_of(
    increments: Iterable[Increment], variable: str, units: UnitSystem | None = None
) -> Reach | None:
    """Return the range of a variable (SI) that the flights of any of the increments cover, and
    where the last of them has faded; None where none is limited by it."""
    acting = [each for each in increments if _limits(each, variable)]
    if not acting:
        return None
    intervals = [each.envelope[variable] for each in acting]
    factor, unit = display_unit(variable, units)
    gone = (
        factor * min(each.low - 2.0 * each.cell for each in intervals),
        factor * max(each.high + 2.0 * each.cell for each in intervals),
    )
    return Reach(
        variable,
        factor * min(each.low for each in intervals),
        factor * max(each.high for each in intervals),
        gone if all(each.margins is None for each in acting) else None,
        unit or "",
    )


def beyond_words(
    increments: Sequence[Increment], among: Collection[str] = (), units: UnitSystem | None = None
) -> list[str]:
    """Return a sentence per reach (`Reach.sentence`, display units) of the variables that the
    regressors of increments depend on, with the axes that share it; empty without increments.

    among : only these variables, also where regressors do not depend on them; empty: all.
    """
    axes: dict[str, list[str]] = {}
    for increment in increments:
        own = {name for regressor in increment.regressors for name in regressor.names}
        for variable in sorted((set(among) or own) & increment.envelope.keys()):
            reach = reach_of([i for i in increments if i.axis == increment.axis], variable, units)
            if reach is not None and increment.axis not in axes.setdefault(reach.sentence, []):
                axes[reach.sentence].append(increment.axis)
    return [f"{listed(each)}: {sentence}." for sentence, each in axes.items()]


def beyond_data(before: AeroDatabase, after: AeroDatabase) -> list[str]:
    """Return `beyond_words` (display units) of the increments that only one of two databases
    has."""
    return beyond_words((*new_increments(after, before), *new_increments(before, after)))


def _limits(increment: Increment, variable: str) -> bool:
    """Whether a regressor of the increment changes at the edge of the variable's envelope."""
    return any(variable in increment.limiting(k) for k in range(len(increment.regressors)))
