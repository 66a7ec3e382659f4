"""Stall hysteresis: lift, drag and pitching moment of flow that separates and reattaches late.

Model, with X of a state model (`flow_attachment`, 1 attached): ``C_lift += k (((1 + sqrt X)/2)^2 -
1)(alpha - alpha_0)``, ``C_drag += k (1 - X)``, ``Cm += k (1 - X)``, each with its own k; alpha_0 is
the database's own zero-lift angle. Believable size: up to the whole lift-curve slope; drag up to
that of a flat plate.

Data needed: flight into the stall and back out of it.

The shape of X is nonlinear in its parameters, so it is fixed before any flight is judged: by
default the start values of Jategaonkar (2015) for a transport aircraft; better, fitted by
`stall_shape.cross_fit_shapes` on the *other* flights, so that each flight's estimate stays
independent.

>>> from aerodb.effects.template import value
>>> value(LIFT.format("alpha"), alpha=0.2, flow_attachment=1.0)
0.0
>>> value(LIFT.format("alpha"), alpha=0.2, flow_attachment=0.0)
-0.15
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from aerodb.effects.aerodynamic import from_zero_lift
from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.template import LibraryContext, Template
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


@dataclass(frozen=True)
class _Gain:
    """The parameter of one axis: name, unit, plausible range, and the clause for reports."""

    parameter: str
    unit: str
    plausible: tuple[float, float]
    because: str


_GAINS: Final = {
    "C_lift": _Gain(
        "C_lift_X", "1/rad", (0.0, 7.0), "lift that is lost in a stall and comes back late"
    ),
    "C_drag": _Gain(
        "C_drag_X",
        "1",
        (0.0, 2.0),
        "drag of flow that separates in a stall and attaches late",
    ),
    "Cm": _Gain(
        "Cm_X",
        "1",
        (-2.0, 2.0),
        "pitching moment of flow that separates in a stall and attaches late",
    ),
}
#: Body axes on which each parameter acts.
_BODY_AXES: Final = {"C_lift": ("CX", "CZ"), "C_drag": ("CX", "CY", "CZ"), "Cm": ("Cm",)}


def stall_regressors(database: AeroDatabase) -> dict[str, Expression]:
    """Regressors of the stall gains over `flow_attachment`: axis -> expression.

    Angles are in rad.
    """
    separated = parse(SEPARATED)
    return {
        "C_lift": parse(LIFT.format(from_zero_lift(database))),
        "C_drag": separated,
        "Cm": separated,
    }


def stall_hypotheses(
    context: LibraryContext, laws: Law | Mapping[str, Law], subject: str = ""
) -> list[Hypothesis]:
    """Return the hypotheses of stall hysteresis on lift, drag and pitching moment, one scalar gain
    each, in the unit of `_GAINS`.

    Parameters
    ----------
    context : what the library is made for.
    laws : one law for all flights, or flight id -> law (cross-fitted). A flight without a law
        cannot show the effect: its columns are zero.
    subject : distinguishes several laws in one library.
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
    hypotheses = []
    for axis, regressor in stall_regressors(context.database).items():
        gain = _GAINS[axis]
        hypotheses.append(
            Hypothesis(
                effect="stall_hysteresis",
                axes=_BODY_AXES[axis],
                subject=subject,
                parameter=gain.parameter,
                kind="aerodynamic",
                unit=gain.unit,
                plausible=gain.plausible,
                prior_sigma=None,
                because=gain.because,
                increment=((axis, regressor),),
                tangent=partial(columns, axis=axis, regressor=regressor, laws=states, one=one),
                formula=f"{axis} += k*({regressor}); {STATE_CHANNEL} of {text}",
                needs=tuple(needs),
                source=SOURCE,
            )
        )
    return hypotheses


def template(laws: Sequence[Law]) -> Template:
    """Return the stall-hysteresis template with these laws instead of the default one; columns are
    (n,), see `stall_hypotheses`."""

    def expanded(context: LibraryContext) -> list[Hypothesis]:
        named = [
            ("" if len(laws) == 1 else f"shape {number}", law)
            for number, law in enumerate(laws, start=1)
        ]
        return [item for subject, law in named for item in stall_hypotheses(context, law, subject)]

    formula = f"C_lift += k*{LIFT.format('(alpha - alpha_0)')}; C_drag, Cm += k*({SEPARATED})"
    return Template("stall_hysteresis", "aerodynamic", formula, SOURCE, expanded)


TEMPLATE = template((START,))


def columns(
    view: FlightView, *, axis: str, regressor: Expression, laws: Mapping[str, Law], one: bool
) -> Columns:
    """Evaluate `regressor` along a flight, with the flow attachment given by the flight's law.

    Returns body axis -> (n,); zero for a flight without a law. one : whether `laws` holds one law
    for all flights, under the key "".
    """
    law = laws.get("" if one else view.flight)
    zero = np.zeros(len(view.time))
    if law is None:
        return dict.fromkeys(_BODY_AXES[axis], zero)
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
    """Add an accepted stall to `database`: the state model of `law` and one increment per gain.

    Parameters
    ----------
    gains : axis -> (value, standard error), in the units of the axis.
    envelope, flights : as for `Increment`.

    Raises
    ------
    InputError : the database already has such a state model, or a stall does not act on an axis.
    """
    if any(state.name == STATE_CHANNEL for state in database.states):
        what = f"the database already has a state model of {STATE_CHANNEL}"
        raise InputError(what, f"database {database.name}", "start from the version without it")
    known = stall_regressors(database)
    increments = []
    for axis, (value, error) in gains.items():
        if axis not in known:
            raise InputError(
                f"stall hysteresis does not act on axis '{axis}'",
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
                _GAINS[axis].because,
            )
        )
    state = StateModel(STATE_CHANNEL, law, description)
    return replace(
        database, states=(*database.states, state), increments=(*database.increments, *increments)
    )
