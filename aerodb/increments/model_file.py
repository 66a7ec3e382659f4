"""The model file: the increments declared for estimation (Phoenix, 003 eq. 7, as data).

```toml
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "q_hat", "delta_body_flap"]
breaks = {alpha = [0.175]}          # one slope per interval, continuous unless jump = true
knots = {q_hat = "-0.02, 0, 0.02", "delta_body_flap over alpha" = "1, 5, 9 deg"}
spline = "cubic"                    # or "linear"
prior = {q_hat = [-5.0, 2.0]}       # value, one sigma
bounds = {alpha = [-1.0, 1.0]}
fixed = {delta_body_flap = 0.0}
own_constants = true                # one constant per flight; the estimate of "1" is their mean
```

Of a roll on the ground, parameters of the legs:

```toml
parameters = ["mu_brake", "mu_side"]
wind = ["-3 m/s", "1 m/s"]          # of the air, to the north and to the east; left out: unknown
```

A term is any expression over canonical channels. Slopes after a break are named ``alpha > 0.175``.
A term with knots is a spline: ``alpha = [...]`` makes the term alpha any function of alpha, whose
estimates ``alpha at 0.0873`` are its values at the knots; ``delta over alpha`` makes the slope of
delta one. Beside the constant "1" the first knot has no estimate of its own: "1" is the value there
and the others are differences from it. Knots are in SI units, or text with a unit; "chosen" leaves
them to the flights.
With one constant for all flights, differences between flights (trim, CG, loading) bias the slopes;
`own_constants` prevents that.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from aerodb.errors import InputError, nearest
from aerodb.estimation import SplineKind
from aerodb.increments.spline_terms import (
    increasing,
    knots_from_text,
    spline_expressions,
    split_key,
)
from aerodb.nomenclature import is_hinge_axis
from aerodb.support import Strict, parsed_toml, validated
from aerodb.tables import INCREMENT_AXES, Expression, parse
from aerodb.units import quantity

#: The term that is a constant.
CONSTANT = "1"


class DeclaredIncrement(Strict):
    """One axis of the model file; the keys are described in the module docstring."""

    axis: str
    terms: tuple[str, ...] = Field(min_length=1)
    breaks: dict[str, tuple[float, ...]] = {}
    jump: bool = False
    knots: dict[str, tuple[float, ...]] = {}
    spline: SplineKind = "linear"
    prior: dict[str, tuple[float, float]] = {}
    bounds: dict[str, tuple[float, float]] = {}
    fixed: dict[str, float] = {}
    own_constants: bool = False

    @field_validator("knots", mode="before")
    @classmethod
    def _in_si(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        return {key: knots_from_text(str(key), value) for key, value in given.items()}

    @model_validator(mode="after")
    def _consistent(self) -> "DeclaredIncrement":
        if self.axis not in INCREMENT_AXES and not is_hinge_axis(self.axis):
            raise ValueError(f"unknown axis '{self.axis}'; {nearest(self.axis, INCREMENT_AXES)}")
        if len(set(self.terms)) != len(self.terms):
            raise ValueError("a term is listed twice")
        if self.own_constants and CONSTANT not in self.terms:
            raise ValueError("own_constants without the term '1'")
        for name, points in self.breaks.items():
            if name not in self.terms:
                raise ValueError(
                    f"breaks of '{name}', which is not a term; {nearest(name, self.terms)}"
                )
            if any(b <= a for a, b in pairwise(points)):
                raise ValueError(f"breaks of '{name}' must increase")
        self._check_knots()
        names = [regressor.name for regressor in expand(self)]
        for label, entries in (
            ("prior", self.prior),
            ("bounds", self.bounds),
            ("fixed", self.fixed),
        ):
            for name in entries:
                if name not in names:
                    raise ValueError(
                        f"{label} of '{name}', which is not a term; {nearest(name, names)}"
                    )
        for name, (low, high) in self.bounds.items():
            if low >= high:
                raise ValueError(f"bounds of '{name}' must be (lower, upper)")
        for name, (_, sigma) in self.prior.items():
            if sigma <= 0:
                raise ValueError(f"prior of '{name}' needs a positive sigma")
        return self

    def _check_knots(self) -> None:
        seen = set()
        for key, points in self.knots.items():
            term, variable = split_key(key)
            if term not in self.terms:
                raise ValueError(
                    f"knots of '{term}', which is not a term; {nearest(term, self.terms)}"
                )
            if term in seen or term in self.breaks:
                raise ValueError(f"'{term}' has knots or breaks twice")
            if term == CONSTANT and variable == CONSTANT:
                raise ValueError("knots of '1' need a variable, such as '1 over alpha'")
            if term == CONSTANT and self.own_constants:
                raise ValueError("own_constants with knots of '1'")
            if points and not increasing(points):
                raise ValueError(f"knots of '{key}' must be at least two and increase")
            seen.add(term)


class ModelFile(Strict):
    """All declared increments, one entry per axis, and parameters of the database to estimate.

    inertias : those of the vehicle that are estimated beside, by methods that fly: ``Ixz``.
    own_constants : whether each flight has a constant of its own on each axis beside parameters, as
        biased sensors leave; without, what is constant tells of the parameters too: the thrust that
        carries a hover.
    wind : steady wind north and east [m/s] of rolls on the ground, such as the tower's; unknown
        where it is left out.
    """

    increment: tuple[DeclaredIncrement, ...] = ()
    parameters: tuple[str, ...] = ()
    inertias: tuple[Literal["Ixx", "Iyy", "Izz", "Ixz"], ...] = ()
    own_constants: bool = True
    wind: tuple[float, float] | None = None

    @field_validator("wind", mode="before")
    @classmethod
    def _in_metres_per_second(cls, given: Any) -> Any:
        if not isinstance(given, list | tuple):
            return given
        return tuple(quantity(value, "m/s") for value in given)

    @model_validator(mode="after")
    def _once(self) -> "ModelFile":
        if not self.increment and not self.parameters:
            raise ValueError("neither [[increment]] nor parameters")
        if not self.own_constants and not self.parameters:
            raise ValueError("own_constants at the top is of parameters; [[increment]] has its own")
        for what, names in (("a parameter", self.parameters), ("an inertia", self.inertias)):
            if twice := sorted({name for name in names if names.count(name) > 1}):
                raise ValueError(f"{what} stands twice: {', '.join(twice)}")
        axes = [entry.axis for entry in self.increment]
        if len(set(axes)) != len(axes):
            raise ValueError("an axis is declared twice")
        return self


@dataclass(frozen=True)
class Regressor:
    """A column of the regression: its name in reports, and its expression."""

    name: str
    expression: Expression


def expand(declared: DeclaredIncrement) -> tuple[Regressor, ...]:
    """Return the regressors of a declared increment, breaks and knots in SI units ([rad] for
    angles): each term, split into one slope per interval where breaks are given, and into one
    function per knot where knots are (`spline_expressions`).

    >>> lift = DeclaredIncrement(axis="CZ", terms=("1", "alpha"), breaks={"alpha": (0.175,)})
    >>> [regressor.name for regressor in expand(lift)]
    ['1', 'alpha', 'alpha > 0.175']
    """
    regressors: list[Regressor] = []
    # A spline whose knots are yet to be chosen counts as a single term.
    splines = {
        split_key(key)[0]: (split_key(key)[1], at) for key, at in declared.knots.items() if at
    }
    constant = CONSTANT in declared.terms and CONSTANT not in splines
    for term in declared.terms:
        if term in splines:
            variable, knots = splines[term]
            regressors.extend(
                Regressor(name, parse(text))
                for name, text in spline_expressions(
                    term, variable, knots, declared.spline, constant and term == variable
                )
            )
            continue
        edges = declared.breaks.get(term, ())
        if not edges:
            regressors.append(Regressor(term, parse(term)))
            continue
        regressors.append(Regressor(term, parse(f"min({term}, {edges[0]!r})")))
        for low, high in zip(edges, (*edges[1:], None), strict=True):
            part = (
                f"max({term} - {low!r}, 0)"
                if high is None
                else f"clip({term} - {low!r}, 0, {high - low!r})"
            )
            regressors.append(Regressor(f"{term} > {low:g}", parse(part)))
            if declared.jump:
                regressors.append(
                    Regressor(f"{term} jump at {low:g}", parse(f"step({term} - {low!r})"))
                )
    return tuple(regressors)


def parse_model_file(text: str | Mapping[str, Any], where: str = "model file") -> ModelFile:
    """Parse a model file from TOML text, or from what such a text holds.

    Raises InputError naming the wrong key, with the nearest known one. Angles with a unit become
    rad; schema: docs/reference/conventions.md, section Model file.
    """
    data = parsed_toml(text, where) if isinstance(text, str) else text
    return validated(ModelFile, data, where)


def check_channels(model: ModelFile, known: Iterable[str], where: str = "model file") -> None:
    """Raise InputError, with the nearest known name, for a term that uses a channel that the
    flights lack. See docs/reference/conventions.md, section Model file."""
    names = set(known)
    for declared in model.increment:
        for regressor in expand(declared):
            for name in sorted(regressor.expression.names):
                if name not in names:
                    what = f"increment on {declared.axis}: no channel '{name}' in these flights"
                    raise InputError(what, where, nearest(name, names))
