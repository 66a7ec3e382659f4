"""The library of a campaign: the hypotheses, the settings of tracing, and their hash."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from aerodb.effects import Hypothesis
from aerodb.tables import Law, Relay
from aerodb.tracing import TracingSettings


@dataclass(frozen=True)
class Library:
    """Hypotheses, settings of tracing, and the hash of both; fixed before any residual is read.

    stall : flight -> the law of its stall that the *other* flights agree with; its family is part
    of the hash, its numbers are not. Empty where fewer than two flights stall. lift_hysteresis :
    likewise, angles of the lift hysteresis that is its rival. reconstructed : flow angles that
    no flight has a sensor of: no sensor of theirs is a hypothesis.
    """

    hypotheses: tuple[Hypothesis, ...]
    settings: TracingSettings
    sha256: str
    stall: Mapping[str, Law] = field(default_factory=dict)
    lift_hysteresis: Mapping[str, Relay] = field(default_factory=dict)
    reconstructed: frozenset[str] = frozenset()

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on hypotheses that are not in it, for the report (docs/method/tracing.md,
        section 18)."""
        if not self.reconstructed:
            return ()
        angles = " and ".join(
            {"alpha": "angle of attack", "beta": "sideslip"}[name]
            for name in sorted(self.reconstructed)
        )
        what = (
            f"No flight has a sensor of {angles}: errors of such a sensor are no hypotheses, those"
            " of the reconstruction are"
        )
        return (
            (
                f"{what}. What stays open between them and the model, a flight with a vane or a"
                " five-hole probe decides."
            ),
        )
