"""Declared terms alone, or with all terms of the database freed beside them: which predicts flights
that were left out better.

After a fault an aircraft differs from its database by few terms, such as those of a locked surface.
With the terms of the database held, these few are estimated well from little data. Freed, all are
estimated, and errors of the database are corrected too.

References
----------
"Parameter Identification for Application within a Fault-Tolerant Flight Control System" (nominal
coefficients held while those of the single surfaces are estimated).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan
from typing import Final, Literal

from aerodb.errors import InputError
from aerodb.increments.model_file import CONSTANT, ModelFile
from aerodb.increments.validation import AxisValidation
from aerodb.support import SLIGHT
from aerodb.tables import AeroDatabase, Expression, Operation, value_of

#: Part of the held-out error of an axis by which freeing all terms must lower it to be worth them.
#: Errors of two legs of one manoeuvre differ by about as much. Dimensionless.
WORTH: Final = SLIGHT


@dataclass(frozen=True)
class HeldOrFree:
    """Errors of the two variants.

    Parameters
    ----------
    errors : axis -> rms error on held-out flights (dimensionless) before, with the terms of the
        database held, and with all freed.
    keep : the variant to take.
    because : why, in a sentence.
    """

    errors: dict[str, tuple[float, float, float]]
    keep: Literal["held", "free"]
    because: str


def with_all_terms_free(model: ModelFile, database: AeroDatabase) -> ModelFile:
    """Return the declared increments with all terms of the database on the same axes beside them.

    Raises InputError for declared parameters, and for a term of the database that is no number
    times a regressor.

    >>> from aerodb.increments import DeclaredIncrement
    >>> from aerodb.tables import AeroDatabase, ReferenceGeometry, Term, parse
    >>> geometry = ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0))
    >>> known = AeroDatabase("one", geometry, terms=(Term("slope", "Cm", parse("-0.5*alpha")),))
    >>> model = ModelFile(increment=(DeclaredIncrement(axis="Cm", terms=("delta_elevator",)),))
    >>> with_all_terms_free(model, known).increment[0].terms
    ('delta_elevator', 'alpha')
    """
    if not model.increment:
        raise InputError(
            "it declares no increments", "model file", "give [[increment]] with the new terms"
        )
    found = []
    for declared in model.increment:
        own = [_regressor(t.name, t.expression) for t in database.terms if t.axis == declared.axis]
        known = {increment.axis for increment in database.increments}
        if declared.axis in known:
            raise InputError(
                f"{declared.axis} has increments of earlier flights",
                f"database {database.name}",
                "give the version without them as --baseline",
            )
        more = tuple(dict.fromkeys(each for each in own if each not in declared.terms))
        found.append(declared.model_copy(update={"terms": declared.terms + more}))
    return model.model_copy(update={"increment": tuple(found)})


def _regressor(name: str, expression: Expression) -> str:
    """What a number multiplies in a term; "1" for a number alone."""
    if not isnan(value_of(expression)):
        return CONSTANT
    if (
        isinstance(expression, Operation)
        and expression.operator == "*"
        and not isnan(value_of(expression.left))
    ):
        return str(expression.right)
    raise InputError(
        f"the term '{name}' is no number times a regressor",
        "--all-free",
        "write the terms to free into a second model file, and update with each",
    )


def held_or_free(
    declared: Sequence[str], held: Sequence[AxisValidation], free: Sequence[AxisValidation]
) -> HeldOrFree:
    """Compare validations of both variants on the declared axes (held-out rms, dimensionless).

    Raises InputError where no flight was left out.
    """
    freed = {each.axis: each for each in free}
    errors = {}
    for each in held:
        after = freed[each.axis].held_out_rms_after if each.axis in freed else None
        if each.axis not in declared or each.held_out_rms_after is None or after is None:
            continue
        errors[each.axis] = (each.held_out_rms_before or 0.0, each.held_out_rms_after, after)
    if not errors:
        raise InputError(
            "no flight is held out, so that the variants cannot be compared",
            "--all-free",
            "give more flights, or name those to hold out with --hold-out",
        )
    better = [axis for axis, (_, kept, all_) in errors.items() if all_ < (1.0 - WORTH) * kept]
    worse = [axis for axis, (_, kept, all_) in errors.items() if (1.0 - WORTH) * all_ > kept]
    if better and not worse:
        return HeldOrFree(
            errors,
            "free",
            f"With all terms free, {' and '.join(better)} is predicted better by more than"
            f" {100 * WORTH:.0f} %",
        )
    why = (
        f"All terms free predict {' and '.join(worse)} worse"
        if worse
        else f"All terms free predict no axis better by {100 * WORTH:.0f} %"
    )
    return HeldOrFree(errors, "held", why)
