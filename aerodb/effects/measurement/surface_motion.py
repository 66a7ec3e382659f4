"""Surfaces that do not follow what the log shows: late, with backlash, with a dead zone.

``surface_delay``: the surface follows the log by tau; tangent ``-deltadot dC/ddelta``, 1/s.

``surface_backlash``: play of half-width w between what is logged and the surface (Tao & Kokotovic
1996, eq. 2.3): the surface rests until the log has moved by 2 w. Tangent ``(play(delta, w0) -
delta) / w0 dC/ddelta``. Which strokes are lost depends on the play, so there are two hypotheses,
with w0 a fifth and (``surface_wide_backlash``) two thirds of the rms deflection.

``surface_dead_zone``: the surface begins to move w from zero; tangent ``-sat(delta / w0)
dC/ddelta`` with w0 a third of the rms deflection.

Believable size: 10 ms for a logger's and an actuator's delay that is not stated, half a second for
a fault; play of .05 deg for a sound linkage, several degrees for a worn one. Source: Tao &
Kokotovic, *Adaptive Control of Systems with Actuator and Sensor Nonlinearities*, 1996.
"""

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.measurement.sensor import delay_prior, predicted_change, sensor
from aerodb.effects.surfaces import Deflection, Role
from aerodb.effects.template import LibraryContext, Template, read_alone
from aerodb.signals import played, smooth
from aerodb.support import Array

SOURCE: Final = "Tao & Kokotovic 1996"
#: Half-widths of which the tangents are made, in parts of the rms deflection about its mean; at
#: least [rad].
_NARROW: Final = 0.2
_MIDDLE: Final = 1.0 / 3.0
_WIDE: Final = 2.0 / 3.0
_LEAST: Final = 1e-3
#: Kinds of surfaces that move to and fro.
_MOVING: Final[frozenset[Role]] = frozenset({"pitch", "roll", "yaw"})


def half_width(values: Array, share: float = _MIDDLE) -> float:
    """Half-width [rad] of which the tangents of a deflection (n,) are made; share : of its rms."""
    return max(_LEAST, share * float(np.nanstd(values)))


def delay(view: FlightView, surface: Deflection) -> Columns:
    """Columns of surface_delay of a deflection. Each is (n,), 1/s."""
    moved = smooth(view[surface.channel], view.step, view.bandwidth).rate
    return predicted_change(view, **surface.with_sides(moved))


def backlash(view: FlightView, surface: Deflection, share: float) -> Columns:
    """Columns of surface_backlash of a deflection; share : as in `half_width`. Each is (n,), per
    rad of half-width."""
    values = view[surface.channel]
    width = half_width(values, share)
    return predicted_change(view, **surface.with_sides((values - played(values, width)) / width))


def dead_zone(view: FlightView, surface: Deflection) -> Columns:
    """Columns of surface_dead_zone of a deflection. Each is (n,), per rad of half-width."""
    values = view[surface.channel]
    moved = np.clip(values / half_width(values), -1.0, 1.0)
    return predicted_change(view, **surface.with_sides(moved))


def _template(
    effect: str,
    tangent: Callable[..., Columns],
    *,
    unit: str,
    plausible: tuple[float, float],
    natural: float,
    formula: str,
    because: str,
) -> Template:
    name = effect.removeprefix("surface_")

    def hypotheses(context: LibraryContext) -> list[Hypothesis]:
        return [
            sensor(
                context,
                effect,
                f"{surface.channel}_{name}",
                partial(tangent, surface=surface),
                unit=unit,
                plausible=plausible,
                declared=delay_prior(context, surface.channel) if name == "delay" else 0.0,
                natural=natural,
                because=f"the {surface.words} {because}",
                formula=" ".join(
                    formula.format(delta=channel)
                    for channel in (surface.channel, *read_alone(context, *surface.sides))
                ),
                needs=(surface.channel,),
                source=SOURCE,
                subject=surface.name,
            )
            for surface in context.surfaces
            if surface.role in _MOVING
        ]

    return Template(effect, "sensor", formula.format(delta="delta"), SOURCE, hypotheses)


DELAY = _template(
    "surface_delay",
    delay,
    unit="s",
    plausible=(-0.2, 0.5),
    natural=0.01,
    formula="-{delta}dot*dC/d{delta}",
    because="moves later or earlier than the log says",
)
BACKLASH, WIDE_BACKLASH = (
    _template(
        effect,
        partial(backlash, share=share),
        unit="rad",
        plausible=(-0.004, 0.06),
        natural=0.0009,
        formula=f"(play({{delta}}, {share:.2g} rms) - {{delta}})*dC/d{{delta}}",
        because="has backlash: it rests while the log reverses",
    )
    for effect, share in (("surface_backlash", _NARROW), ("surface_wide_backlash", _WIDE))
)
DEAD_ZONE = _template(
    "surface_dead_zone",
    dead_zone,
    unit="rad",
    plausible=(-0.004, 0.06),
    natural=0.0009,
    formula="-sat({delta})*dC/d{delta}",
    because="does not answer small deflections about zero",
)
TEMPLATES = (DELAY, BACKLASH, WIDE_BACKLASH, DEAD_ZONE)
#: Their effects.
SURFACE_MOTION: Final = frozenset(template.effect for template in TEMPLATES)
