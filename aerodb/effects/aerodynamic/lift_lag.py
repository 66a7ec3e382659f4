"""Lift that follows the angle of attack late: unsteady circulation, flow that takes its time.

Model: ``C_lift += k (alpha_lagged - alpha)`` with ``n c/V d(alpha_lagged)/dt = alpha -
alpha_lagged``; k is the slope of what lags, and n one of `LAGS`. Of slow motion it is
``-2 n k alphadot_hat``, a shape of `alpha_dot`. Believable size: none of the lift to all of it.

Data needed: pitching at frequencies about ``V/(2 pi n c)``, below which it is `alpha_dot`.

The state is a channel of the database that holds the effect (`with_lags`).

>>> from aerodb.effects.template import value
>>> value(regressor(8), alpha=0.1, alpha_lagged_8=0.08)
-0.02
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis, evaluated
from aerodb.effects.template import LibraryContext, Template, additive
from aerodb.support import Array
from aerodb.tables import AeroDatabase, Rate, StateModel, number, parse

EFFECT: Final = "lift_lag"
SOURCE: Final = "Wagner 1925, as R. T. Jones, NACA Report 681, 1940, approximates it"
#: Lags n [chords flown]: of an airfoil's circulation (Wagner's two lags are 1.7 and 11), of a wing
#: near the stall (Jategaonkar 2015, chapter 12: 21). A lag between two of them has a gain of its
#: own, and an eighth of its effect at most is left.
LAGS: Final = (3, 5, 8, 13, 21, 34)
#: Largest slope [1/rad] of what lags: a little above the lift slope of a wing, 2 pi.
_LARGEST: Final = 8.0
#: Airspeed [m/s] below which nothing flies.
_STANDING: Final = 1.0
_CHANNEL: Final = "alpha_lagged_"


def regressor(lag: int) -> str:
    """How far the angle of attack of the lift is behind [rad], as an expression; lag : one of
    `LAGS`."""
    return f"{_CHANNEL}{lag} - alpha"


def lagged(view: FlightView, lag: int) -> Array:
    """The angle of attack (n,) [rad] that the lift follows, steady at the first sample; lag
    [chords]."""
    from aerodb.tables import relaxed  # loads the compiler

    return relaxed(
        view.time, view["alpha"], lag * view.reference.chord / np.maximum(view["V"], _STANDING)
    )


def with_lagged(view: FlightView, hypotheses: Iterable[Hypothesis]) -> FlightView:
    """Return the view with the channels (n,) that these hypotheses read and their database does not
    have yet."""
    made = {f"{_CHANNEL}{lag}": lagged(view, lag) for lag in _read(hypotheses)}
    return replace(view, channels={**made, **view.channels}) if made else view


def with_lags(database: AeroDatabase, hypotheses: Iterable[Hypothesis]) -> AeroDatabase:
    """Return `database` with the states that these hypotheses read and it lacks: angles of attack
    [rad] whose rates [rad/s] are what they are behind over the lag."""
    for lag in _read(hypotheses):
        name, chords = f"{_CHANNEL}{lag}", number(lag * database.reference.chord)
        if name in database.free_inputs:
            continue
        rate = Rate(parse(f"(alpha - {name})*V/{chords}"), unit="rad")
        what = f"angle of attack that the lift follows, {lag} chords behind"
        database = replace(
            database,
            states=(*database.states, StateModel(name, rate, what)),
            free_inputs={**database.free_inputs, name: what},
        )
    return database


def _read(hypotheses: Iterable[Hypothesis]) -> list[int]:
    """The lags [chords] that they read."""
    names = frozenset[str]().union(
        *(each.names for hypothesis in hypotheses for _, each in hypothesis.increment)
    )
    return [lag for lag in LAGS if f"{_CHANNEL}{lag}" in names]


def _columns(view: FlightView, of: Hypothesis) -> Columns:
    return evaluated(of.increment, with_lagged(view, [of]))


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    found = []
    for lag in LAGS:
        made = additive(
            context,
            EFFECT,
            "CZ",
            regressor(lag),
            size=_LARGEST,
            unit="1/rad",
            grows=f"that follows the angle of attack late, by about {lag} chords flown",
            name=f"lag_{lag}",
            subject=f"{lag}_chords",
            source=SOURCE,
        )
        made = replace(
            made,
            formula=f"{made.formula}; {lag} c/V d({_CHANNEL}{lag})/dt = alpha - {_CHANNEL}{lag}",
            needs=("V", "alpha"),
            limit="alpha_dot",
        )
        found.append(replace(made, tangent=partial(_columns, of=made)))
    return found


TEMPLATE = Template(
    EFFECT,
    "aerodynamic",
    "CZ += k*(alpha_lagged - alpha); n*c/V*d(alpha_lagged)/dt = alpha - alpha_lagged",
    SOURCE,
    _hypotheses,
)
