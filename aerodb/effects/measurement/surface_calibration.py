"""Control-surface calibration errors and faults: deflections that differ from the log.

``surface_scale``: the log shows ``(1 + s)`` times the deflection. Tangent ``-sum delta dC/ddelta``
over one surface, or over both deflections of a left/right pair, which share one calibration.

``surface_bias``: the log shows the deflection plus b, a zero that was rigged or calibrated wrong.
Tangent ``-dC/ddelta``. Where the model is linear in the deflection this is a constant, and each
flight's own constant takes it: a residual shows little of it, but it limits what a zero term means.

``surface_asymmetry`` as a vehicle fault: one surface of a pair moves less than logged by a share k,
which is 1 when it is jammed. Tangent ``-delta dC/ddelta`` of that surface alone.

Believable size: 3 % for a calibration, a quarter of a degree for its zero; anything up to 1 for a
fault, also of a single surface.
Source: 003, eq. 6; docs/reference/conventions.md, "Axes, signs, units" (logs hold commands).
"""

from dataclasses import replace
from functools import partial

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.measurement.sensor import BELIEVED, bias_prior, predicted_change, sensor
from aerodb.effects.surfaces import Deflection
from aerodb.effects.template import LibraryContext, Template, read_alone

SOURCE = "003, eq. 6"
#: Nodes from 0 to 1 of the mean slope over an error's size, and their weights (Gauss and Legendre).
_NODES, _WEIGHTS = (0.5 * values for values in np.polynomial.legendre.leggauss(5))
_NODES = _NODES + 0.5


def scale(view: FlightView, channels: tuple[str, ...]) -> Columns:
    """Columns of surface_scale of deflections that share one calibration: combinations and the
    surfaces that they are made of, of which the database reads either.

    Each column is (n,), dimensionless.
    """
    return predicted_change(view, **{name: view[name] for name in channels if view.has([name])})


def bias(view: FlightView, surface: Deflection) -> Columns:
    """Columns of surface_bias of one deflection.

    Each column is (n,), per unit of the deflection.
    """
    return predicted_change(view, **surface.with_sides(1.0))


def bias_of(view: FlightView, size: float, surface: Deflection) -> Columns:
    """Columns of surface_bias of a `size`, which is the change of the prediction over that size.

    Each column is (n,), per unit of the deflection. Drag that grows with the deflection to either
    side changes its sign within an error of some degrees, and its tangent does not.
    """
    whole = surface.with_sides(size)

    def there(share: float) -> FlightView:
        moved = {n: view[n] - share * each for n, each in whole.items() if n in view.channels}
        return replace(view, channels={**view.channels, **moved}, _slopes={})

    parts = [bias(there(share), surface) for share in _NODES]
    return {
        axis: sum(
            (weight * part[axis] for weight, part in zip(_WEIGHTS, parts, strict=True)),
            np.zeros(len(view.time)),
        )
        for axis in parts[0]
    }


def fault(view: FlightView, surface: str, symmetric: str, asymmetric: str, side: float) -> Columns:
    """Columns of a surface (`side` +1 right, -1 left) that moves less than logged, through the
    deflections that it is part of, and through its own where the database reads it.

    Each column is (n,), dimensionless.
    """
    half = 0.5 * view[surface]
    changes = {surface: view[surface], symmetric: half, asymmetric: side * half}
    return predicted_change(view, **{name: change for name, change in changes.items() if name})


def pairs(context: LibraryContext) -> dict[tuple[str, str], list[Deflection]]:
    """(right, left) -> the combinations that flights have of these two surfaces."""
    by_sides: dict[tuple[str, str], list[Deflection]] = {}
    for surface in context.surfaces:
        if surface.right:
            by_sides.setdefault((surface.right, surface.left), []).append(surface)
    return by_sides


def pair_name(right: str, left: str) -> str:
    """Return what two surfaces are called together.

    >>> pair_name("elevon_inboard_right", "elevon_inboard_left"), pair_name("a", "b")
    ('elevon_inboard', 'a_b')
    """
    common = [
        one for one, other in zip(right.split("_"), left.split("_"), strict=False) if one == other
    ]
    return "_".join(common) or f"{right}_{left}"


def _scale(context: LibraryContext) -> list[Hypothesis]:
    groups = {
        pair_name(*sides): tuple(s.channel for s in surfaces)
        for sides, surfaces in pairs(context).items()
    }
    single = {surface.name: (surface.channel,) for surface in context.surfaces if not surface.right}
    measured = single | {
        pair_name(*sides): tuple(f"delta_{side}" for side in sides) for sides in pairs(context)
    }
    groups |= single
    sides = {pair_name(*pair): tuple(f"delta_{side}" for side in pair) for pair in pairs(context)}
    return [
        sensor(
            context,
            "surface_scale",
            f"delta_{name}_scale",
            partial(scale, channels=(*channels, *sides.get(name, ()))),
            unit="1",
            plausible=(-0.5, 1.1),
            natural=0.03,
            because=(
                f"the {name.replace('_', ' ')} deflects in proportion less or more than the log"
                " says"
            ),
            formula=" ".join(
                f"- {channel}*dC/d{channel}"
                for channel in (*channels, *read_alone(context, *sides.get(name, ())))
            ),
            needs=channels,
            source=SOURCE,
            subject=name,
            measured=measured[name],
        )
        for name, channels in sorted(groups.items())
        if not name.endswith("gear")
    ]


def _bias(context: LibraryContext) -> list[Hypothesis]:
    hypotheses = []
    for surface in context.surfaces:
        if surface.name.endswith("gear"):
            continue
        parts = (surface.channel, f"delta_{surface.right}", f"delta_{surface.left}")
        stated = max(bias_prior(context, part) for part in parts)
        most = BELIEVED * stated if stated else 0.06
        found = sensor(
            context,
            "surface_bias",
            f"{surface.channel}_bias",
            partial(bias, surface=surface),
            unit="rad",
            plausible=(-most, most),
            natural=0.0044,
            because=(
                f"the {surface.name.replace('_', ' ')} deflects by a constant less or more than"
                " the log says"
            ),
            formula=" ".join(
                f"-dC/d{channel}"
                for channel in (surface.channel, *read_alone(context, *surface.sides))
            ),
            needs=(surface.channel,),
            source=SOURCE,
            subject=surface.name,
            declared=stated,
            secant=partial(bias_of, surface=surface),
        )
        known_by = found.known_by or ("the vehicle file" if stated else "")
        hypotheses.append(replace(found, known_by=known_by))
    return hypotheses


def _fault(context: LibraryContext) -> list[Hypothesis]:
    hypotheses = []
    for sides, combined in pairs(context).items():
        kinds = {
            context.vehicle.combinations[surface.name].kind: surface.channel for surface in combined
        }
        symmetric, asymmetric = kinds.get("symmetric", ""), kinds.get("asymmetric", "")
        for name, side in zip(sides, (1.0, -1.0), strict=True):
            channel = f"delta_{name}"
            hypotheses.append(
                sensor(
                    context,
                    "surface_asymmetry",
                    f"{channel}_lost",
                    partial(
                        fault,
                        surface=channel,
                        symmetric=symmetric,
                        asymmetric=asymmetric,
                        side=side,
                    ),
                    unit="1",
                    plausible=(-0.3, 1.1),
                    natural=0.02,
                    because=(
                        f"the {name.replace('_', ' ')} moves less than the log says, or is stuck"
                    ),
                    formula=f"-{channel}*dC/d{channel}"
                    + "".join(f", {each} alone" for each in read_alone(context, channel)),
                    needs=(channel, *kinds.values()),
                    source=SOURCE,
                    subject=name,
                )
            )
    return hypotheses


SCALE = Template("surface_scale", "sensor", "-delta*dC/ddelta", SOURCE, _scale)
BIAS = Template("surface_bias", "sensor", "-dC/ddelta", SOURCE, _bias)
FAULT = Template("surface_asymmetry", "sensor", "-delta*dC/ddelta of one side", SOURCE, _fault)
TEMPLATES = (SCALE, BIAS, FAULT)
