"""Templates of the user: effects in a TOML file, or Python packages that register some.

```toml [[effect]] name = "wing_rock"                       # or the name of an effect of the
library, with a subject of its own axes = ["Cl"] expression = "alpha*p_hat*abs(beta)"     # over
channels; parsed, never run plausible = [-5.0, 5.0] because = "rolling moment that grows with roll
rate, angle of attack and sideslip" source = "Elzebda, Nayfeh, Mook, J. Aircraft 26(8), 1989" ```

A package registers under the entry point group ``aerodb.effects`` a `Template`, or a function
without arguments that gives some.
"""

import re
from collections.abc import Iterable
from importlib.metadata import entry_points
from typing import Final

from pydantic import Field, model_validator

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.template import LibraryContext, Template, on_axis
from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.nomenclature import channel
from aerodb.support import Strict, validated_toml
from aerodb.tables import INCREMENT_AXES, Expression, parse

GROUP: Final = "aerodb.effects"
_NAME: Final = re.compile(r"[a-z][a-z0-9_]*")


class UserEffect(Strict):
    """One ``[[effect]]``; see the module's text. Each axis has a parameter of its own."""

    name: str
    axes: tuple[str, ...] = Field(min_length=1)
    expression: str
    plausible: tuple[float, float]
    because: str = Field(min_length=1)
    source: str = ""
    subject: str = ""
    unit: str = "1"

    @model_validator(mode="after")
    def _consistent(self) -> "UserEffect":
        for label, word in (("name", self.name), ("subject", self.subject or "none")):
            if not _NAME.fullmatch(word):
                raise ValueError(
                    f"{label} '{word}' is not lower case letters, digits and underscores"
                )
        for axis in self.axes:
            if axis not in INCREMENT_AXES:
                raise ValueError(f"unknown axis '{axis}'; {nearest(axis, INCREMENT_AXES)}")
        if len(set(self.axes)) != len(self.axes):
            raise ValueError("an axis stands twice")
        if not self.plausible[0] < self.plausible[1]:
            raise ValueError("plausible must be [lower, upper]")
        _parsed(self.expression)
        return self


class UserEffects(Strict):
    """All effects of a file."""

    effect: tuple[UserEffect, ...] = Field(min_length=1)


def parse_effects(text: str, where: str = "effect file") -> tuple[Template, ...]:
    """Return templates from the text of a TOML file (docs/reference/conventions.md, section Effects
    file).

    Raises InputError that names the key, the position in an expression or the unknown channel, with
    the nearest known one.
    """
    return tuple(_template(effect) for effect in validated_toml(UserEffects, text, where).effect)


def registered_templates() -> tuple[Template, ...]:
    """Return templates of installed packages, in the order of their entry points' names (group
    `GROUP`).

    Raises InputError that names the entry point which cannot be loaded or gives something else.
    """
    registered: list[Template] = []
    for point in sorted(entry_points(group=GROUP), key=lambda point: (point.name, point.value)):
        where, remedy = (
            f"entry point {GROUP}: {point.name} = {point.value}",
            "mend or uninstall the package that registers it",
        )
        try:
            given = point.load()
            templates = list(given()) if callable(given) else [given]
        except (
            Exception
        ) as error:  # whatever a foreign package does wrong, the reader must learn which it was
            raise InputError(
                f"cannot be loaded: {type(error).__name__}: {error}", where, remedy
            ) from error
        for template in templates:
            if not isinstance(template, Template):
                raise InputError(
                    f"gives a {type(template).__name__}, not a Template", where, remedy
                )
            registered.append(template)
    return tuple(registered)


def _parsed(text: str) -> Expression:
    expression = parse(text)
    if expression.tables:
        known = "an increment is made of channels and functions only"
        raise InputError(
            f"no function '{sorted(expression.tables)[0]}'", f"expression '{text}'", known
        )
    for name in sorted(expression.names):
        try:
            channel(name)
        except UnknownNameError as error:
            raise InputError(error.what, f"expression '{text}'", error.remedy) from None
    return expression


def _template(effect: UserEffect) -> Template:
    expression = _parsed(effect.expression)

    def hypotheses(context: LibraryContext) -> Iterable[Hypothesis]:
        return [
            on_axis(
                effect.name,
                axis,
                expression,
                unit=effect.unit,
                plausible=effect.plausible,
                because=effect.because,
                parameter=f"{axis}_{effect.subject or effect.name}",
                subject=effect.subject,
                source=effect.source,
            )
            for axis in effect.axes
        ]

    formula = f"{', '.join(effect.axes)} += k*({expression})"
    return Template(effect.name, "aerodynamic", formula, effect.source, hypotheses)
