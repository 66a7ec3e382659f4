"""What a user admits to the database beyond what is confirmed, and what of it did not enter."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from aerodb.errors import InputError, nearest
from aerodb.loop.frozen_library import Library
from aerodb.tracing import ADDED, Finding

#: In place of a name: every finding with the verdict of the option.
ALL: Final = "all"
#: Verdict -> the option that admits it.
_OPTION: Final = {
    "alias_group": "lumped",
    "suspected": "suspected",
    "ambiguous_sensor": "ambiguous",
}


@dataclass(frozen=True)
class Accept:
    """Effects (names or hypotheses' ids, or `ALL`) that the user admits beyond the confirmed ones.

    lumped : although they are in an alias group; suspected : although they are only suspected;
    ambiguous : although an error of a sensor explains them as well.
    """

    lumped: tuple[str, ...] = ()
    suspected: tuple[str, ...] = ()
    ambiguous: tuple[str, ...] = ()

    def admits(self, finding: Finding) -> bool:
        """Return whether a finding enters the database: by its verdict (`ADDED`) or because the
        user asked for it."""
        return finding.verdict in ADDED or self.asks_for(finding)

    def asks_for(self, finding: Finding) -> bool:
        """Return whether the user asked for this finding with its verdict."""
        option = _OPTION.get(finding.verdict)
        return any(own == option and _is(finding, name) for own, name in self._asked())

    def check(self, library: Library) -> None:
        """Raise InputError for a name that is neither an effect nor an id of the library."""
        known = {
            name for hypothesis in library.hypotheses for name in (hypothesis.effect, hypothesis.id)
        }
        for _, name in self._asked():
            if name != ALL and name not in known:
                effects = {hypothesis.effect for hypothesis in library.hypotheses}
                raise InputError(
                    f"no effect '{name}' is known",
                    "close-loop",
                    nearest(name, effects, len(effects)),
                )

    def not_added(
        self, findings: Sequence[Finding], added: Sequence[Finding], without_gain: Collection[str]
    ) -> dict[str, str]:
        """Return what the user asked for and did not get: name -> why, and what would bring it.

        findings, added, without_gain : of the `LoopResult`.
        """
        reasons = {}
        for option, name in self._asked():
            if name == ALL or any(_is(finding, name) for finding in added):
                continue
            own = [finding for finding in findings if _is(finding, name)]
            open_ones = [
                f
                for f in findings
                if f not in (*own, *added) and f.verdict in _OPTION and not self.asks_for(f)
            ]
            reasons[name] = _why_not(own, option, open_ones, without_gain)
        return reasons

    def _asked(self) -> Iterator[tuple[str, str]]:
        """Each option with each name that was given to it."""
        for option, names in (
            ("lumped", self.lumped),
            ("suspected", self.suspected),
            ("ambiguous", self.ambiguous),
        ):
            for name in names:
                yield option, name


def _is(finding: Finding, name: str) -> bool:
    """Return whether a name, an effect or an id, means a finding."""
    return name in (ALL, finding.hypothesis, finding.effect)


def _why_not(
    own: Sequence[Finding],
    option: str,
    open_ones: Sequence[Finding],
    without_gain: Collection[str],
) -> str:
    """Why none of the findings that a name means was added.

    open_ones : other findings that the user may ask for, and has not.
    """
    if not own:
        return "these flights do not find it"
    if not any(_OPTION.get(finding.verdict) == option for finding in own):
        verdict, other = own[0].verdict.replace("_", " "), _OPTION.get(own[0].verdict)
        return f"its verdict is {verdict}" + (f": ask with --accept-{other}" if other else "")
    if any(finding.hypothesis in without_gain for finding in own):
        return "it lowers no error of flights that did not identify"
    axes = {axis for finding in own for axis in finding.axis}
    beside = [
        f"--accept-{_OPTION[f.verdict]} {f.hypothesis}" for f in open_ones if axes & set(f.axis)
    ]
    if not beside:
        return "with it an axis would become worse"
    return (
        "it was estimated beside others, and without them an axis would become worse: add also"
        f" {' '.join(beside)}"
    )
