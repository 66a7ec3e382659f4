"""Results of tracing: findings with their rivals, and a bound for everything else.

Frozen; names and verdicts as in docs/reference/contract.md.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Final, Literal

from aerodb.remarks import Remark

Verdict = Literal[
    "confirmed",
    "suspected",
    "alias_group",
    "ambiguous_sensor",
    "sensor",
    "unnamed",
    "not_detected",
    "not_excited",
    "not_separable",
    "not_testable",
]

#: Verdicts by which an effect enters the database without being asked for.
ADDED: Final[tuple[Verdict, ...]] = ("confirmed",)


def with_unit(value: float, unit: str, digits: int = 3) -> str:
    """Format a number for people; dimensionless numbers carry no unit.

    >>> with_unit(0.0123, "rad", 2), with_unit(2.0, "1")
    ('0.012 rad', '2')
    """
    return f"{value:.{digits}g}" + ("" if unit in ("", "1") else f" {unit}")


@dataclass(frozen=True)
class Vote:
    """A flight's vote: its own estimate of the parameter, and the sigma that whitened noise gives
    it, SI.

    Every flight has one vote, and all count alike in the mean.
    """

    flight: str
    value: float
    se: float


@dataclass(frozen=True)
class MeanTest:
    """The test of the mean of the votes against zero, SI.

    p : of a mean of zero, of this hypothesis alone. ci95 : the means that it does not reject at
    5 %; zero is outside if and only if p is below .05.
    """

    mean: float
    ci95: tuple[float, float]
    p: float


@dataclass(frozen=True)
class Wanted:
    """A measurement outside flight that would tell a finding from a sensor.

    parameter : of the sensor, as ``[measured]`` of the vehicle file names it. sigma : one standard
    deviation, in `unit` (SI), from which the sensor could not be blamed; None where the flights
    hardly say how large its error would have to be.
    """

    parameter: str
    sigma: float | None
    unit: str


@dataclass(frozen=True)
class Finding:
    """One effect that the model lacks, or one sensor that is wrong.

    hypothesis : id in the library. axis, parameter, unit, value, ci95 : of its one parameter, SI,
    as it would enter the database; ci95 holds random and systematic parts, and what the shape of
    its term misses anywhere in the envelope, so that it can contain zero although the mean over the
    flights is not zero. test : of that mean. p_adjusted : p of the test, adjusted over the whole
    library. votes : the
    per-flight estimates. explanation_set : ids that explain it equally well, itself first. what :
    what is wrong, in words. size : the parameter with its value and interval, and on what it rests.
    reasons : of the verdict, a clause each. fallen : id -> why that rival was rejected. refound :
    in how many of how many repetitions without some of the flights it was found again.
    held_out_share : share of the flights on which the value from the other flights lowers the
    error. wanted : measurements outside flight that would decide about the sensors in its set; in
    the document of what is `ambiguous_sensor`.
    """

    hypothesis: str
    effect: str
    axis: tuple[str, ...]
    subject: str
    verdict: Verdict
    parameter: str
    unit: str
    value: float
    ci95: tuple[float, float]
    p_adjusted: float
    votes: tuple[Vote, ...]
    explanation_set: tuple[str, ...]
    what: str
    size: str
    reasons: tuple[str, ...]
    fallen: Mapping[str, Remark] = field(default_factory=dict)
    refound: tuple[int, int] = (0, 0)
    held_out_share: float = 0.0
    shape: Mapping[str, Any] | None = None
    test: MeanTest | None = None
    wanted: tuple[Wanted, ...] = ()

    @property
    def because(self) -> str:
        """One plain sentence: what, how large, and why this verdict."""
        return "; ".join((f"{self.what}: {self.size}", *self.reasons))

    def document(self) -> dict[str, Any]:
        """Return it as JSON of docs/reference/contract.md: value, interval (2,) and votes in the
        unit of the hypothesis."""
        return {
            **_named(self),
            "value": self.value,
            "ci95": list(self.ci95),
            "p_adjusted": self.p_adjusted,
            **(
                {}
                if self.test is None
                else {
                    "test": {
                        "mean": self.test.mean,
                        "ci95": list(self.test.ci95),
                        "p": self.test.p,
                    }
                }
            ),
            "votes": [
                {"flight": vote.flight, "value": vote.value, "se": vote.se} for vote in self.votes
            ],
            "explanation_set": list(self.explanation_set),
            "because": self.because,
            "what": self.what,
            "reasons": list(self.reasons),
            "fallen": {id: remark.sentence for id, remark in self.fallen.items()},
            "fallen_data": {
                id: remark.document() for id, remark in self.fallen.items() if remark.values
            },
            "refound": list(self.refound),
            "held_out_share": self.held_out_share,
            **({} if self.shape is None else {"shape": dict(self.shape)}),
            **(
                {"wanted": [asdict(each) for each in self.wanted]}
                if self.verdict == "ambiguous_sensor"
                else {}
            ),
        }


def only_suspected(finding: Finding, but: str) -> Finding:
    """Return the finding as `suspected`, with one more reason in its sentence."""
    return doubted(finding, but, verdict="suspected")


def doubted(finding: Finding, but: str, **changes: Any) -> Finding:
    """Return the finding with one more reason in its sentence, and these other fields."""
    return replace(finding, reasons=(*finding.reasons, f"but {but}"), **changes)


@dataclass(frozen=True)
class NotFound:
    """A hypothesis of which nothing was found, with what the flights exclude.

    upper_bound : larger values are excluded (95 %). minimum_detectable : size that would have been
    found with power .8. Both are None where the flights say nothing: no flight excites the
    hypothesis, or it cannot be told from the others. believable : range of the parameter; an upper
    bound beyond it excludes nothing.
    """

    hypothesis: str
    effect: str
    axis: tuple[str, ...]
    subject: str
    verdict: Verdict
    parameter: str
    unit: str
    upper_bound: float | None
    minimum_detectable: float | None
    believable: tuple[float, float] | None = None

    def document(self) -> dict[str, Any]:
        """Return it as JSON of docs/reference/contract.md: bounds are scalars in the unit of the
        hypothesis."""
        return {
            **_named(self),
            "upper_bound": self.upper_bound,
            "minimum_detectable": self.minimum_detectable,
            **({} if self.believable is None else {"believable": list(self.believable)}),
        }


def _named(item: Finding | NotFound) -> dict[str, Any]:
    """First entries of a document: hypothesis, axes, subject, verdict, parameter."""
    return {
        "hypothesis": item.hypothesis,
        "effect": item.effect,
        "axis": list(item.axis),
        "subject": item.subject,
        "verdict": item.verdict,
        "parameter": item.parameter,
        "unit": item.unit,
    }


@dataclass(frozen=True)
class Traced:
    """The result of tracing: findings, bounds for all other hypotheses, and what to fly next."""

    flights: tuple[str, ...]
    findings: tuple[Finding, ...]
    not_found: tuple[NotFound, ...]
    next_flight: tuple[str, ...]
    notes: tuple[str, ...]

    def named(self, *verdicts: Verdict) -> tuple[Finding, ...]:
        """Return the findings with one of these verdicts."""
        return tuple(finding for finding in self.findings if finding.verdict in verdicts)

    def document(self) -> dict[str, Any]:
        """Return the parts of docs/reference/contract.md's JSON that tracing knows; numbers carry
        SI units, named with each finding."""
        return {
            "findings": [finding.document() for finding in self.findings],
            "not_found": [item.document() for item in self.not_found],
            "next_flight": list(self.next_flight),
        }
