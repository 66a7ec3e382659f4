"""Stall hysteresis: lift, drag and pitching moment of flow that separates and reattaches late.

Model, with X of a state model (`flow_attachment`, 1 attached): ``C_lift += k (((1 + sqrt X)/2)^2 -
1)(alpha - alpha_0)``, ``C_drag += k (1 - X)``, ``Cm += k (1 - X)``, each with its own k; alpha_0 is
the database's own zero-lift angle. Believable size: up to the whole lift-curve slope; drag up to
that of a flat plate.

Data needed: flight into the stall and back out of it.

The shape of X is nonlinear in its parameters, so it is fixed before any flight is judged: by
default the start values of Jategaonkar (2015) for a transport aircraft; better, fitted by
`stall_shape.cross_fitted` on the *other* flights, so that each flight's estimate stays independent.

>>> from aerodb.effects.template import value
>>> value(LIFT.format("alpha"), alpha=0.2, flow_attachment=1.0)
0.0
>>> value(LIFT.format("alpha"), alpha=0.2, flow_attachment=0.0)
-0.15
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from aerodb.effects.aerodynamic import from_zero_lift
from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.template import Scene, Template
from aerodb.errors import InputError, nearest
from aerodb.nomenclature import FORCE_AXES
from aerodb.tables import (
    STATE_CHANNEL,
    WIND_AXES,
    AeroDatabase,
    Expression,
    Increment,
    Interval,
    Kirchhoff,
    Law,
    StateModel,
    evaluate,
    parse,
    wind_to_body,
)

LIFT: Final = f"{{}}*(((1 + sqrt({STATE_CHANNEL}))/2)^2 - 1)"
SEPARATED: Final = f"1 - {STATE_CHANNEL}"
SOURCE = (
    "Leishman & Beddoes, J. AHS 34(3), 1989; Goman & Khrabrov, J. Aircraft 31(5), 1994; Jategaonkar"
    " 2015, chapter 12"
)
#: Start values of Jategaonkar (2015), for ATTAS.
START: Final[Law] = Kirchhoff(sharpness=35.0, alpha_star=0.29, lag=21.0)

#: Axis -> parameter, unit, believable range, and the clause for reports.
_AXES: Final = {
    "C_lift": ("C_lift_X", "1/rad", (0.0, 7.0), "lift that is lost in a stall and comes back late"),
    "C_drag": (
        "C_drag_X",
        "1",
        (0.0, 2.0),
        "drag of flow that separates in a stall and attaches late",
    ),
    "Cm": (
        "Cm_X",
        "1",
        (-2.0, 2.0),
        "pitching moment of flow that separates in a stall and attaches late",
    ),
}
#: Body axes on which one parameter is felt.
_FELT_ON: Final = {"C_lift": ("CX", "CZ"), "C_drag": ("CX", "CY", "CZ"), "Cm": ("Cm",)}


def regressors(database: AeroDatabase) -> dict[str, Expression]:
    """Axis -> what its gain multiplies, over `flow_attachment`."""
    separated = parse(SEPARATED)
    return {
        "C_lift": parse(LIFT.format(from_zero_lift(database))),
        "C_drag": separated,
        "Cm": separated,
    }


def hypotheses(scene: Scene, laws: Law | Mapping[str, Law], subject: str = "") -> list[Hypothesis]:
    """The stall on lift, drag and pitching moment, by a law of one shape, or of one per flight
    (cross-fitted).

    subject : tells several laws in one library apart. Flights that `laws` does not hold cannot show
    it: their columns are zero.
    """
    one = not isinstance(laws, Mapping)
    states = {"": laws} if not isinstance(laws, Mapping) else dict(laws)
    needs = sorted(
        {
            "alpha",
            *(name for law in states.values() for name in StateModel(STATE_CHANNEL, law).needs),
        }
    )
    text = (
        str(states[""])
        if one
        else "; ".join(f"{flight}: {law}" for flight, law in sorted(states.items()))
    )
    found = []
    for axis, regressor in regressors(scene.database).items():
        parameter, unit, plausible, because = _AXES[axis]
        found.append(
            Hypothesis(
                effect="stall_hysteresis",
                axes=_FELT_ON[axis],
                subject=subject,
                parameter=parameter,
                kind="aerodynamic",
                unit=unit,
                plausible=plausible,
                prior_sigma=None,
                because=because,
                increment=((axis, regressor),),
                tangent=partial(columns, axis=axis, regressor=regressor, laws=states, one=one),
                formula=f"{axis} += k*({regressor}); {STATE_CHANNEL} of {text}",
                needs=tuple(needs),
                source=SOURCE,
            )
        )
    return found


def template(laws: Sequence[Law]) -> Template:
    """The stall with these shapes, in place of the default one."""

    def expanded(scene: Scene) -> list[Hypothesis]:
        named = [
            ("" if len(laws) == 1 else f"shape {number}", law)
            for number, law in enumerate(laws, start=1)
        ]
        return [item for subject, law in named for item in hypotheses(scene, law, subject)]

    formula = f"C_lift += k*{LIFT.format('(alpha - alpha_0)')}; C_drag, Cm += k*({SEPARATED})"
    return Template("stall_hysteresis", "aerodynamic", formula, SOURCE, expanded)


TEMPLATE = template((START,))


def columns(
    view: FlightView, *, axis: str, regressor: Expression, laws: Mapping[str, Law], one: bool
) -> Columns:
    """Body axis -> (n,): `regressor` along a flight, the flow attached by its law; zero for flights
    without one."""
    law = laws.get("" if one else view.flight)
    zero = np.zeros(len(view.time))
    if law is None:
        return dict.fromkeys(_FELT_ON[axis], zero)
    state = StateModel(STATE_CHANNEL, law)
    attached = state.along(
        view.time, {name: view[name] for name in state.needs}, view.reference.chord
    )
    column = evaluate(regressor, {**view.channels, STATE_CHANNEL: attached})
    if axis not in WIND_AXES:
        return {axis: column}
    drag, side, lift = (column if axis == wind else 0.0 for wind in WIND_AXES)
    parts = wind_to_body(drag, side, lift, view["alpha"], view["beta"])
    return {body: part + zero for body, part in zip(FORCE_AXES, parts, strict=True)}


def with_stall(
    database: AeroDatabase,
    law: Law,
    gains: Mapping[str, tuple[float, float]],
    envelope: Mapping[str, Interval],
    flights: Sequence[str],
    description: str = "",
) -> AeroDatabase:
    """`database` with the state model of `law` and an increment per axis of `gains` that uses it: a
    finding, added.

    gains : axis -> value and standard error. envelope, flights : as an `Increment` has them.

    Raises InputError where the database has such a state already, and for an axis that a stall does
    not act on.
    """
    if any(state.name == STATE_CHANNEL for state in database.states):
        what = f"it has a state model of {STATE_CHANNEL} already"
        raise InputError(what, f"database {database.name}", "start from the version before it")
    known = regressors(database)
    increments = []
    for axis, (value, error) in gains.items():
        if axis not in known:
            raise InputError(
                f"a stall has no gain on '{axis}'",
                f"database {database.name}",
                nearest(axis, known),
            )
        estimates, covariance = np.array([value]), np.array([[error**2]])
        increments.append(
            Increment(
                axis,
                (known[axis],),
                estimates,
                covariance,
                envelope,
                tuple(flights),
                _AXES[axis][3],
            )
        )
    state = StateModel(STATE_CHANNEL, law, description)
    return replace(
        database, states=(*database.states, state), increments=(*database.increments, *increments)
    )
