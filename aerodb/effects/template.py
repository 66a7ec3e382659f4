"""Templates: how an effect becomes hypotheses for one database and one vehicle.

Templates are expanded before any flight is looked at.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

from aerodb.effects.hypothesis import Hypothesis, Kind, needed_channels
from aerodb.effects.surfaces import Deflection, surfaces_of
from aerodb.tables import WIND_AXES, AeroDatabase, Expression, evaluate, parse
from aerodb.vehicle import Vehicle

#: Axis -> its name in a sentence.
AXIS_WORDS: Final[Mapping[str, str]] = {
    "CX": "force along x",
    "CY": "side force",
    "CZ": "force along z",
    "Cl": "rolling moment",
    "Cm": "pitching moment",
    "Cn": "yawing moment",
    "C_drag": "drag",
    "C_side": "side force",
    "C_lift": "lift",
}

#: Body axis -> the wind axis that takes its place in a database whose forces are written along the
#: wind axes.
_ON_WIND: Final = {"CX": "C_drag", "CY": "C_side", "CZ": "C_lift"}
#: Wind axis -> body axes on which a parameter along it acts.
WIND_TO_BODY_AXES: Final = {
    "C_drag": ("CX", "CY", "CZ"),
    "C_side": ("CX", "CY", "CZ"),
    "C_lift": ("CX", "CZ"),
}

#: Channels that a view computes from others.
_MADE_OF: Final = {"alphadot": "alpha", "betadot": "beta"}


@dataclass(frozen=True)
class LibrarySettings:
    """Settings of a library, fixed and hashed before residuals are looked at.

    Attributes
    ----------
    effects : names of the effects to expand; empty: all.
    alpha_breaks : angles of attack [rad] at which slopes may change, in addition to the database's
        own kinks (0.175 is 10 deg, the break of 003, eq. 7).
    """

    effects: tuple[str, ...] = ()
    alpha_breaks: tuple[float, ...] = (0.175,)


@dataclass(frozen=True, eq=False)
class LibraryContext:
    """What a library is made for, and all that templates may use.

    Attributes
    ----------
    database, vehicle : the model and the vehicle file.
    channels : names of the channels that flights have.
    priors : sensor parameter -> one sigma (SI), from flight-path reconstruction or a calibration;
        overrides the vehicle file.
    settings : of the library.
    """

    database: AeroDatabase
    vehicle: Vehicle
    channels: frozenset[str]
    priors: Mapping[str, float] = field(default_factory=dict)
    settings: LibrarySettings = LibrarySettings()

    @cached_property
    def surfaces(self) -> tuple[Deflection, ...]:
        """Control surfaces that flights have and that may move."""
        return surfaces_of(self.vehicle, self.channels)

    @cached_property
    def on_wind_axes(self) -> bool:
        """Whether the database writes forces on wind axes; hypotheses then do so too."""
        return any(term.axis in WIND_AXES for term in self.database.terms)

    def axis(self, body: str) -> str:
        """The axis on which the database writes the effect along a body axis."""
        return _ON_WIND.get(body, body) if self.on_wind_axes else body

    def knows(self, needs: Iterable[str]) -> bool:
        """Return whether flights have all of these channels, or the channels they are computed
        from."""
        return all(
            _MADE_OF.get(name, name) in self.channels or name in self.channels for name in needs
        )

    def sigma(self, parameter: str, declared: float, natural: float) -> float:
        """One sigma of a sensor parameter: its prior, else `declared` (vehicle file), else
        `natural`.

        All are in the unit of the parameter.
        """
        return self.priors.get(parameter) or declared or natural


@dataclass(frozen=True)
class Template:
    """An effect: `hypotheses` expands it for a context. formula, source : for people; version :
    raised when it changes."""

    effect: str
    kind: Kind
    formula: str
    source: str
    hypotheses: Callable[[LibraryContext], Iterable[Hypothesis]]
    version: int = 1


def read_alone(context: LibraryContext, *channels: str) -> tuple[str, ...]:
    """Return those deflections, of surfaces that flights combine, that the database reads by
    themselves: errors act through them too. Part of formulas, and so of the library's hash; an
    n-tuple, no units."""
    return tuple(name for name in channels if name in context.database.inputs)


def additive(
    context: LibraryContext,
    effect: str,
    axis: str,
    regressor: str,
    *,
    size: float,
    unit: str,
    grows: str,
    name: str,
    subject: str = "",
    source: str = "",
) -> Hypothesis:
    """An aerodynamic hypothesis ``C_axis += parameter * regressor``, on the axis on which the
    database writes it.

    Parameters
    ----------
    axis : body axis.
    regressor : expression over channels.
    size : largest believable correction, of either sign, in `unit`.
    name : suffix of the parameter's name, after the axis.
    grows : continuation of the clause for reports, after the name of the axis.
    """
    own = context.axis(axis)
    return on_axis(
        effect,
        own,
        parse(regressor),
        unit=unit,
        plausible=(-size, size),
        because=f"{AXIS_WORDS[own]} {grows}",
        parameter=f"{own}_{name}",
        subject=subject,
        source=source,
    )


def on_axis(
    effect: str,
    axis: str,
    regressor: Expression,
    *,
    unit: str,
    plausible: tuple[float, float],
    because: str,
    parameter: str,
    subject: str = "",
    source: str = "",
) -> Hypothesis:
    """Return an aerodynamic hypothesis on exactly this body or wind axis; unit : of its scalar
    parameter, `plausible` in the same."""
    on_wind = axis in WIND_AXES
    return Hypothesis(
        effect=effect,
        axes=WIND_TO_BODY_AXES.get(axis, (axis,)),
        subject=subject,
        parameter=parameter,
        kind="aerodynamic",
        unit=unit,
        plausible=plausible,
        prior_sigma=None,
        because=because,
        increment=((axis, regressor),),
        formula=f"{axis} += k*({regressor})",
        needs=tuple(sorted({*needed_channels(regressor), *(("alpha",) if on_wind else ())})),
        source=source,
    )


def per_axis(
    effect: str,
    regressor: str,
    sizes: Mapping[str, float],
    *,
    unit: str,
    grows: str,
    name: str,
    source: str,
) -> Template:
    """The template ``C_axis += k * regressor`` on each axis of `sizes` (body axis -> largest
    believable k).

    `unit` is that of k.
    """

    def hypotheses(context: LibraryContext) -> list[Hypothesis]:
        return [
            additive(
                context,
                effect,
                axis,
                regressor,
                size=size,
                unit=unit,
                grows=grows,
                name=name,
                source=source,
            )
            for axis, size in sizes.items()
        ]

    return Template(
        effect, "aerodynamic", f"{', '.join(sizes)} += k*({regressor})", source, hypotheses
    )


def value(regressor: str, **channels: float) -> float:
    """Evaluate a regressor at one point (scalars in SI units), for the doctests of the templates.

    >>> value("max(alpha - 0.175, 0)", alpha=0.2)
    0.025
    """
    return round(float(evaluate(parse(regressor), channels)), 6)
