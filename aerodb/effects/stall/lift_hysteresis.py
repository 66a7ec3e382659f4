"""Lift hysteresis of a stall: two static branches that meet at the angles where the flow switches.

Model, with X of a relay (`flow_attachment`, 0 from `high` until alpha falls below `low`): ``C_lift
+= k (1 - X)(alpha - alpha_0) max(alpha - low, 0) max(high - alpha, 0)``. Unlike a loss of a share
of the lift (`stall_hysteresis`), lift does not jump at either end; it is lost in between, on the
way back. Believable size: at most half the attached lift, 200 per rad^3 for a loop 15 deg wide.
Source: static loops of airfoils as shown by Mueller, J. Aircraft 22(9), 1985; light aircraft of
JSBSim (aero/stall-hyst-norm).

Data needed: flight into the stall and back out of it. The two angles are fitted by `fitted`, for
each flight's estimate on the *other* flights.

>>> from aerodb.effects.template import value
>>> value(LIFT_LOST.format("alpha", 0.1, 0.3), alpha=0.2, flow_attachment=0.0)
0.002
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.effects.aerodynamic import from_zero_lift
from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.stall import stall_hysteresis
from aerodb.effects.stall.stall_shape import StallFlight, blocked
from aerodb.effects.template import LibraryContext, Template
from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.tables import STATE_CHANNEL, AeroDatabase, Expression, Relay, StateModel, parse

LIFT_LOST: Final = f"(1 - {STATE_CHANNEL})*{{}}*max(alpha - {{!r}}, 0)*max({{!r}} - alpha, 0)"
SOURCE = "Mueller, J. Aircraft 22(9), 1985"
SUBJECT: Final = "loop"
#: Plausible gain, 1/rad^3: lift is lost.
PLAUSIBLE: Final = (-200.0, 0.0)

#: Grid steps of the search for the two angles [rad], and the narrowest loop [rad].
_STEPS: Final = (0.02, 0.005)
_NARROWEST: Final = 0.05


def regressor(database: AeroDatabase, law: Relay) -> Expression:
    """Regressor of the gain over alpha and `flow_attachment`. Alpha is in rad."""
    return parse(LIFT_LOST.format(from_zero_lift(database), law.low, law.high))


def template(law: Relay, others: Mapping[str, Relay] | None = None) -> Template:
    """Return the template of the lift hysteresis (gain [1/rad³]) with this law, in addition to the
    library's stall hysteresis.

    others : flight id -> law on which that flight is judged (cross-fitted); `law` for the rest.
    """
    by_flight = dict(others or {})
    text = "; ".join([str(law), *(f"{flight}: {one}" for flight, one in sorted(by_flight.items()))])

    def expanded(context: LibraryContext) -> list[Hypothesis]:
        lift = next(
            h
            for h in stall_hysteresis.stall_hypotheses(context, law, SUBJECT)
            if h.parameter == "C_lift_X"
        )
        term = regressor(context.database, law)

        def tangent(view: FlightView) -> Columns:
            own = by_flight.get(view.flight, law)
            column = regressor(context.database, own)
            return stall_hysteresis.columns(
                view, axis="C_lift", regressor=column, laws={"": own}, one=True
            )

        return [
            replace(
                lift,
                parameter="C_lift_loop",
                unit="1/rad^3",
                plausible=PLAUSIBLE,
                because="lift that is lost on the way back from a stall",
                increment=(("C_lift", term),),
                tangent=tangent,
                formula=f"C_lift += k*({term}); {STATE_CHANNEL} of {text}",
                source=SOURCE,
            )
        ]

    return Template(
        "stall_hysteresis",
        "aerodynamic",
        f"C_lift += k*{LIFT_LOST.format('(alpha - alpha_0)', 0, 0)}",
        SOURCE,
        expanded,
    )


def with_state(database: AeroDatabase, law: Relay) -> AeroDatabase:
    """Add the state model of `law`, which increments of the loop need, to `database`.

    Raises InputError where the database already has one.
    """
    if any(state.name == STATE_CHANNEL for state in database.states):
        what = f"the database already has a state model of {STATE_CHANNEL}"
        raise InputError(what, f"database {database.name}", "start from the version without it")
    return replace(database, states=(*database.states, StateModel(STATE_CHANNEL, law)))


def fitted(flights: Sequence[StallFlight]) -> Relay:
    """Fit the two switching angles of the lift loop by least squares, on a coarse then a fine grid.

    Each flight has a constant of its own; samples are means over blocks (`stall_shape.blocked`).

    Raises InputError without flights, and where no flight goes far enough into and out of the stall
    for a loop to be visible.
    """
    if not flights:
        raise InputError(
            "no flight", "closed stall loop", "give flights into the stall and back out of it"
        )
    highest = max(float(np.max(flight.alpha[flight.usable])) for flight in flights)
    best: tuple[float, Relay] | None = None
    for step in _STEPS:
        lows, highs = np.arange(0.0, highest, step), np.arange(_NARROWEST, highest, step)
        if best is not None:
            around = _STEPS[0] * np.arange(-1.0, 1.0 + step / 2, step / _STEPS[0])
            lows, highs = best[1].low + around, best[1].high + around
        for low in lows:
            for high in highs[highs >= low + _NARROWEST]:
                law = Relay(round(float(low), 6), round(float(high), 6))
                explained = _explained(flights, law)
                if explained > (best[0] if best else 0.0):
                    best = explained, law
    if best is None:
        raise InputError(
            "no flight goes into a stall and back out of it",
            "closed stall loop",
            "fly a deeper stall",
        )
    return best[1]


def _explained(flights: Sequence[StallFlight], law: Relay) -> float:
    """Reduction of the lift's sum of squares by a loop of this law."""
    columns, residuals = [], []
    for flight in flights:
        lost = 1.0 - flight.attached(law)
        within = np.maximum(flight.alpha - law.low, 0.0) * np.maximum(law.high - flight.alpha, 0.0)
        pair = blocked(
            flight,
            np.column_stack(
                [lost * (flight.alpha - flight.alpha_0) * within, flight.residual["C_lift"]]
            ),
        )
        column, residual = (pair - pair.mean(axis=0)).T
        columns.append(column)
        residuals.append(residual)
    x: Array = np.concatenate(columns)
    y: Array = np.concatenate(residuals)
    size = float(x @ x)
    return float(x @ y) ** 2 / size if size > 0.0 else 0.0
