"""Fields of hand-written files: a number in SI, or text with a unit, which is converted on reading.

They stand apart from `aerodb.units`: a query converts nothing, and does not wait for pydantic.
"""

from typing import Annotated

from pydantic import BeforeValidator, Field

from aerodb.units import quantity


def in_unit(unit: str) -> BeforeValidator:
    """Return a validator that accepts a number in SI, or text such as "6.5 ft", as `unit`."""
    return BeforeValidator(
        lambda value: quantity(value, unit) if isinstance(value, (str, int, float)) else value
    )


Metres = Annotated[float, in_unit("m"), Field(allow_inf_nan=False)]
Radians = Annotated[float, in_unit("rad"), Field(allow_inf_nan=False)]
Seconds = Annotated[float, in_unit("s"), Field(ge=0)]
Kilograms = Annotated[float, in_unit("kg"), Field(gt=0)]
Inertia = Annotated[float, in_unit("kg m^2")]
Number = Annotated[float, in_unit("")]
Point = tuple[Metres, Metres, Metres]
