"""A file of derivatives to be converted: `aerodb derivatives FILE`.

```toml
axes = "body"                       # of dimensional derivatives: "body" or "stability"
forces = "wind"                     # "wind": C_lift and C_drag; "body": CX and CZ
primed = true                       # L and N as in p' = Lp p + Lr r; false: moments over Ixx, Izz
[flight]                            # SI, or text with a unit
mass = "17631 kg"
Ixx = 133367
Iyy = 252687
Izz = 359593
Ixz = 11442
area = 64
chord = 3.159
span = 21.5
pressure = 8810
V = "131 m/s"
alpha = "1.9 deg"
[errors]                            # standard errors of quantities of the flight
Ixx = 2000
[derivatives]                       # value, or value and standard error
Lp = [-2.067, 0.02]
Np = -0.184
```

Coefficients (``Cl_p_hat``) are converted to dimensional derivatives, and those to coefficients. In
place of `[derivatives]` the matrices of a linear model may stand:

```toml
[linear_model]
states = ["beta", "p", "r", "phi"]
inputs = ["delta_aileron"]
A = [[...], ...]
B = [[...], ...]
```

Estimates of one fit are correlated, and the tails that they are to tell of have tables:

```toml
[[correlation]]
of = ["Mq", "Zq"]
value = -0.4
[tail.horizontal]                   # fields of `TailPlane`
plane = "horizontal"
area = "6.5 m^2"
arm = "7.3 m"
pressure_ratio = 1.05
control = "delta_elevator"
```
"""

from typing import Any, Final, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from aerodb.errors import InputError
from aerodb.identification.conversion import (
    Axes,
    Derivatives,
    Forces,
    LinearisedFlight,
    coefficient_derivatives,
    dimensional_derivatives,
    exact,
    matrix_derivatives,
)
from aerodb.identification.tail_planes import TailPlane, tail_parameters
from aerodb.support import Array, Strict, validated_toml
from aerodb.units import quantity

#: Quantity of the flight -> its unit.
_UNITS: Final = {
    "mass": "kg", "Ixx": "kg*m**2", "Iyy": "kg*m**2", "Izz": "kg*m**2", "Ixz": "kg*m**2",
    "area": "m**2", "chord": "m", "span": "m", "pressure": "Pa", "V": "m/s", "alpha": "rad",
    "theta": "rad", "thrust": "N", "thrust_angle": "rad",
}  # fmt: skip
#: Axis of a coefficient -> rows of the linear model that it acts in.
_ROWS: Final = {
    "CX": "X", "CZ": "Z", "C_lift": "XZ", "C_drag": "XZ", "Cm": "M", "CY": "Y", "Cl": "LN",
    "Cn": "LN",
}  # fmt: skip


class MatrixEntry(Strict):
    """``x' = A x + B u``."""

    states: tuple[str, ...] = Field(min_length=1)
    inputs: tuple[str, ...] = ()
    A: tuple[tuple[float, ...], ...]
    B: tuple[tuple[float, ...], ...] = ()

    @model_validator(mode="after")
    def _square(self) -> "MatrixEntry":
        s, m = len(self.states), len(self.inputs)
        if len(self.A) != s or any(len(row) != s for row in self.A):
            raise ValueError(f"A is not {s} by {s}")
        if m and (len(self.B) != s or any(len(row) != m for row in self.B)):
            raise ValueError(f"B is not {s} by {m}")
        return self


class TailEntry(Strict):
    """A tail; see `TailPlane`."""

    plane: Literal["horizontal", "vertical"]
    area: float = Field(gt=0.0)
    arm: float = Field(gt=0.0)
    pressure_ratio: float = Field(1.0, gt=0.0)
    downwash: float = Field(0.0, ge=0.0, lt=1.0)
    control: str = ""

    @field_validator("area", "arm", mode="before")
    @classmethod
    def _in_si(cls, given: Any, info: ValidationInfo) -> Any:
        return quantity(given, "m**2" if info.field_name == "area" else "m")


class CorrelationEntry(Strict):
    """The correlation of two derivatives."""

    of: tuple[str, str]
    value: float = Field(gt=-1.0, lt=1.0)


class DerivativeFile(Strict):
    """The keys of the file; see the module docstring."""

    axes: Axes = "body"
    forces: Forces = "body"
    primed: bool = True
    flight: dict[str, float]
    errors: dict[str, float] = {}
    derivatives: dict[str, tuple[float, float]] = {}
    linear_model: MatrixEntry | None = None
    correlation: tuple[CorrelationEntry, ...] = ()
    tail: dict[str, TailEntry] = {}

    @field_validator("flight", "errors", mode="before")
    @classmethod
    def _in_si(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        return {name: quantity(value, _UNITS.get(name, "")) for name, value in given.items()}

    @field_validator("derivatives", mode="before")
    @classmethod
    def _with_errors(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        return {
            name: (value, 0.0) if isinstance(value, int | float) else value
            for name, value in given.items()
        }

    @model_validator(mode="after")
    def _known(self) -> "DerivativeFile":
        for name in (*self.flight, *self.errors):
            if name not in _UNITS:
                raise ValueError(f"'{name}' is no quantity of a flight; {', '.join(_UNITS)}")
        needed = [
            name for name in _UNITS if name not in ("alpha", "theta", "thrust", "thrust_angle")
        ]
        absent = [name for name in needed if name not in self.flight]
        if absent:
            raise ValueError(f"[flight] lacks {', '.join(absent)}")
        if bool(self.derivatives) == (self.linear_model is not None):
            raise ValueError("it needs [derivatives] or [linear_model]")
        if any(error < 0.0 for _, error in self.derivatives.values()):
            raise ValueError("a standard error is negative")
        for each in self.correlation:
            for name in each.of:
                if name not in self.derivatives:
                    raise ValueError(f"a correlation is of '{name}', which is no derivative here")
        if np.linalg.eigvalsh(self.correlations).min(initial=1.0) <= 0.0:
            raise ValueError("the correlations contradict each other: they are of no covariance")
        return self

    @property
    def correlations(self) -> Array:
        """Correlations (k, k) of the derivatives, without unit."""
        names, matrix = list(self.derivatives), np.eye(len(self.derivatives))
        for each in self.correlation:
            row, column = (names.index(name) for name in each.of)
            matrix[row, column] = matrix[column, row] = each.value
        return matrix

    @property
    def stated(self) -> Derivatives:
        """The derivatives as they stand in the file, (k,), SI, with covariance (k, k)."""
        sigma = np.array([error for _, error in self.derivatives.values()])
        return Derivatives(
            tuple(self.derivatives),
            np.array([value for value, _ in self.derivatives.values()]),
            self.correlations * np.outer(sigma, sigma),
        )


def parse_derivative_file(text: str, where: str) -> DerivativeFile:
    """Parse a file of derivatives. Raises InputError naming the wrong key. Units:
    docs/reference/conventions.md, section File of derivatives."""
    return validated_toml(DerivativeFile, text, where)


def converted(file: DerivativeFile) -> Derivatives:
    """Return the coefficients that the file's dimensional derivatives give, or the reverse.

    Raises InputError for names of neither kind or of both, and where the derivatives do not
    suffice. Derivatives are SI (coefficients per rad or dimensionless rate), with covariance (k,
    k).
    """
    flight = LinearisedFlight(**file.flight)
    if file.linear_model is not None:
        linear = file.linear_model
        b = np.array(linear.B).reshape(len(linear.states), len(linear.inputs))
        derivatives = matrix_derivatives(
            np.array(linear.A), b, linear.states, linear.inputs, flight
        )
        return coefficient_derivatives(
            exact(derivatives), flight, forces=file.forces, errors=file.errors
        )
    given = file.stated
    names = given.names
    coefficients = [name.startswith("C") for name in names]
    if any(coefficients) and not all(coefficients):
        raise InputError(
            "coefficients stand beside dimensional derivatives",
            "derivatives",
            "put each kind into a file of its own",
        )
    if not any(coefficients):
        return coefficient_derivatives(
            given,
            flight,
            axes=file.axes,
            forces=file.forces,
            primed=file.primed,
            errors=file.errors,
        )
    return dimensional_derivatives(
        given, _dimensional_names(names), flight, axes=file.axes, forces=file.forces,
        primed=file.primed, errors=file.errors,
    )  # fmt: skip


def tails_of(file: DerivativeFile) -> list[Derivatives]:
    """Return what the file's derivatives say of each of its tails (k,), with covariance (k, k).

    Raises InputError as `tail_parameters` and `converted`.
    """
    if not file.tail:
        return []
    found = file.stated if any(name[0] == "C" for name in file.derivatives) else converted(file)
    flight = LinearisedFlight(**file.flight)
    return [
        tail_parameters(found, flight, TailPlane(name, **entry.model_dump()))
        for name, entry in file.tail.items()
    ]


def _dimensional_names(names: tuple[str, ...]) -> list[str]:
    """Names of the dimensional derivatives that coefficients act in."""
    found = []
    for name in names:
        axis = next(
            (a for a in sorted(_ROWS, key=len, reverse=True) if name.startswith(f"{a}_")), ""
        )
        if not axis:
            raise InputError(
                f"'{name}' is no derivative of a coefficient",
                "derivatives",
                "name it by axis and variable, such as Cm_alpha or Cl_p_hat",
            )
        variable = name.removeprefix(f"{axis}_").removesuffix("_hat")
        found += [f"{row}{variable}" for row in _ROWS[axis]]
    return list(dict.fromkeys(found))
