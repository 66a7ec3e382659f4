"""Flow-angle errors: bias, scale factor, delay and probe position (angle of attack, sideslip).

A reading with error d changes the prediction by d dC/dangle; the tangent is minus that, of the
angle at the probe: bias ``-dC/dalpha``, scale ``-alpha dC/dalpha``, delay ``+alphadot dC/dalpha``.
A rate derived from the angle has the error's rate. A probe that sits dx further forward than
assumed sees rotation over the additional arm, on both angles.

Believable size: bias .2 to .5 deg, scale a few per cent, delay .01 to .03 s (Twin Otter), position
up to 13 m, where a boom was taken to be at the CG (ATTAS stall records). Source:
docs/method/tracing.md, section 4; Klein & Morelli 2006, section 10.2.

Pitching up at 0.5 rad/s, seen one metre ahead:

>>> changes = flow_changes(np.array([[0.0], [0.0], [-0.5]]), 50.0, 0.0, 0.0)
>>> float(changes["alpha"][0])
-0.01
"""

from functools import partial

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.measurement.sensor import bias_prior, delay_prior, predicted_change, sensor
from aerodb.effects.template import LibraryContext, Template
from aerodb.signals import smooth
from aerodb.support import Array
from aerodb.tables import Value

SOURCE = "Klein & Morelli 2006, section 10.2"
#: No speed below this (m/s) is believed: angles lose their meaning.
SLOWEST = 1e-3
#: One sigma of what is not known of a probe that nobody calibrated: rad, without dimension, s.
NATURAL_ANGLE_ERRORS = {"bias": 0.0035, "scale": 0.02, "delay": 0.01}
WORDS = {"alpha": "angle of attack", "beta": "sideslip"}


def bias(view: FlightView, angle: str) -> Columns:
    """Columns of ``<angle>_bias``, 1/rad. Each column is (n,)."""
    return predicted_change(view, **{angle: 1.0})


def scale(view: FlightView, angle: str) -> Columns:
    """Columns of ``<angle>_scale``. Each column is (n,), dimensionless."""
    return predicted_change(view, **{angle: at_probe(view, angle)})


def delay(view: FlightView, angle: str) -> Columns:
    """Columns of ``<angle>_delay``, 1/s: a reading that is late by t is off by ``-t`` times its
    rate.

    Each column is (n,), in the unit 1/s.
    """
    return predicted_change(
        view, **{angle: -smooth(at_probe(view, angle), view.step, view.bandwidth).rate}
    )


def at_probe(view: FlightView, angle: str) -> Array:
    """The angle (n,) that the probe shows: rotation about the CG moves it through the air.

    It is in rad.
    """
    if not view.air_data_arm.any():
        return view[angle]
    speed, alpha, beta = view["V"], view["alpha"], view["beta"]
    air = speed * np.stack(
        [np.cos(beta) * np.cos(alpha), np.sin(beta), np.cos(beta) * np.sin(alpha)]
    )
    u, v, w = air + np.cross(view.rates, view.air_data_arm).T
    return np.arctan2(w, u) if angle == "alpha" else np.arctan2(v, np.hypot(u, w))


def position(view: FlightView, axis: str) -> Columns:
    """Columns of ``air_data_<axis>``, 1/m: the probe is further along body `axis` than assumed.

    The assumed arm is taken off, ``v - omega x r``, so that what is too little is left in: ``+omega
    x e``.

    Each column is (n,), in the unit 1/m.
    """
    return predicted_change(view, **moved_probe(view, axis))


def moved_probe(view: FlightView, axis: str) -> dict[str, Array]:
    """Changes (n,) of alpha, beta [rad/m] and V [1/s] at the CG per metre that the probe is further
    along body `axis`."""
    unit = np.eye(3)["xyz".index(axis)]
    return flow_changes(
        np.cross(view.rates, unit).T, np.maximum(view["V"], SLOWEST), view["alpha"], view["beta"]
    )


def flow_changes(velocity: Array, speed: Value, alpha: Value, beta: Value) -> dict[str, Array]:
    """Changes (n,) of alpha, beta [rad] and V [m/s] when the velocity in body axes changes by
    `velocity` (3, n) [m/s].

    ``dalpha = (cos alpha dw - sin alpha du)/(V cos beta)``, ``dbeta = (cos beta dv - sin beta (cos
    alpha du + sin alpha dw))/V``, ``dV = cos beta (cos alpha du + sin alpha dw) + sin beta dv``.
    """
    du, dv, dw = velocity
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    along = ca * du + sa * dw
    return {
        "alpha": (ca * dw - sa * du) / (speed * cb),
        "beta": (cb * dv - sb * along) / speed,
        "V": cb * along + sb * dv,
    }


def _template(angle: str, kind: str) -> Template:
    effect, words = f"{angle}_{kind}", WORDS[angle]
    tangent = {"bias": bias, "scale": scale, "delay": delay}[kind]
    formula = {
        "bias": f"-dC/d{angle}",
        "scale": f"-{angle}*dC/d{angle}",
        "delay": f"{angle}dot*dC/d{angle}",
    }[kind]
    because = {
        "bias": f"{words} reads too high or too low by a constant",
        "scale": f"{words} reads in proportion too high or too low",
        "delay": f"{words} is late or early",
    }[kind]
    unit, size = {"bias": ("rad", 0.06), "scale": ("1", 0.3), "delay": ("s", 0.2)}[kind]

    def hypotheses(context: LibraryContext) -> list[Hypothesis]:
        declared = {
            "bias": bias_prior(context, angle),
            "scale": 0.0,
            "delay": delay_prior(context, angle),
        }[kind]
        return [
            sensor(
                context,
                effect,
                effect,
                partial(tangent, angle=angle),
                unit=unit,
                plausible=(-size, size),
                declared=declared,
                natural=NATURAL_ANGLE_ERRORS[kind],
                because=because,
                formula=formula,
                needs=(angle,),
                source=SOURCE,
            )
        ]

    return Template(effect, "sensor", formula, SOURCE, hypotheses)


def _position(context: LibraryContext) -> list[Hypothesis]:
    words = {"x": "ahead of or behind", "z": "below or above"}
    return [
        sensor(
            context,
            "air_data_position",
            f"air_data_{axis}",
            partial(position, axis=axis),
            unit="m",
            plausible=(-20.0, 20.0),
            natural=0.05,
            because=f"the air-data probe sits {where} the point that was assumed",
            formula=f"-dC/dalpha*dalpha/d{axis} - dC/dbeta*dbeta/d{axis}",
            needs=("V", "alpha", "p", "q", "r"),
            source=SOURCE,
            subject=axis,
        )
        for axis, where in words.items()
    ]


POSITION = Template(
    "air_data_position", "sensor", "-dC/dalpha*dalpha/dx - dC/dbeta*dbeta/dx", SOURCE, _position
)
TEMPLATES = (
    *(_template(angle, kind) for angle in WORDS for kind in ("bias", "scale", "delay")),
    POSITION,
)
