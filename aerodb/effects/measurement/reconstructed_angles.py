"""Sensor hypotheses for flow angles that were reconstructed from the motion instead of measured.

Without a vane, no vane bias or delay exists. The reconstructed angle can still have a constant
error (wind), a proportional one (airspeed, unseen gusts) or a delay (velocity over ground), so it
has hypotheses under its own name. It is computed from the accelerations whose residuals tracing
explains: the alpha of a trimmed flight varies as 1/qbar, like the effect of an accelerometer bias.
`remaining_errors` bounds such a bias (docs/method/tracing.md, section 18).
"""

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Final

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.measurement.sensor_flow_angles import WORDS

_SAYS: Final = {
    "bias": "is off by a constant",
    "scale": "is off in proportion",
    "delay": "is late or early",
}
_OF_PROBE: Final = "air_data_position"


def with_reconstructed_angles(
    hypotheses: Iterable[Hypothesis], shown: Collection[str], reconstructed: Collection[str]
) -> tuple[Hypothesis, ...]:
    """Adapt the flow-angle hypotheses to measured (`shown`) and `reconstructed` angles.

    In a campaign in which only some flights have a vane, an angle can be both. Without a measured
    angle there is no probe, and its position is left out.

    >>> with_reconstructed_angles((), (), ("alpha", "beta"))
    ()
    """
    replaced: list[Hypothesis] = []
    for hypothesis in hypotheses:
        angle, _, kind = hypothesis.effect.partition("_")
        if angle in WORDS and kind in _SAYS:
            replaced += [hypothesis] if angle in shown else []
            replaced += (
                [_of_reconstructed(hypothesis, angle, kind)] if angle in reconstructed else []
            )
        elif hypothesis.effect != _OF_PROBE or shown:
            replaced.append(hypothesis)
    return tuple(replaced)


def _of_reconstructed(hypothesis: Hypothesis, angle: str, kind: str) -> Hypothesis:
    """The same column as a hypothesis about the reconstructed angle, which has no sensor."""
    return replace(
        hypothesis,
        effect=f"reconstructed_{angle}",
        subject=kind,
        parameter=f"reconstructed_{hypothesis.parameter}",
        because=f"the {WORDS[angle]} that was reconstructed from the motion {_SAYS[kind]}",
    )


def hypotheses_for_flight(
    hypotheses: Iterable[Hypothesis], reconstructed: Collection[str]
) -> tuple[Hypothesis, ...]:
    """Select a campaign's hypotheses that apply to a flight with these `reconstructed` angles."""
    left_out = {f"{angle}_{kind}" for angle in reconstructed for kind in _SAYS}
    left_out |= {f"reconstructed_{angle}" for angle in WORDS if angle not in reconstructed}
    left_out |= {_OF_PROBE} if set(WORDS) <= set(reconstructed) else set()
    return tuple(hypothesis for hypothesis in hypotheses if hypothesis.effect not in left_out)
