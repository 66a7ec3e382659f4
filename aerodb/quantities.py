"""Numbers as people write them in files: SI, or text with a unit that is converted when the file is
read."""

from typing import Annotated

from pydantic import BeforeValidator, Field

from aerodb.units import quantity


def unit_of(unit: str) -> BeforeValidator:
    """A number in SI, or text such as "6.5 ft" that is converted to `unit`."""
    return BeforeValidator(
        lambda value: quantity(value, unit) if isinstance(value, (str, int, float)) else value
    )


Metres = Annotated[float, unit_of("m")]
Radians = Annotated[float, unit_of("rad")]
Seconds = Annotated[float, unit_of("s"), Field(ge=0)]
Kilograms = Annotated[float, unit_of("kg"), Field(gt=0)]
Inertia = Annotated[float, unit_of("kg m^2")]
Number = Annotated[float, unit_of("")]
Point = tuple[Metres, Metres, Metres]
