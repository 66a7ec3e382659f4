from .conversion import (
    Derivatives,
    SteadyFlight,
    coefficient_derivatives,
    dimensional_derivatives,
    exact,
    matrix_derivatives,
)

__all__ = [
    "Derivatives",
    "SteadyFlight",
    "coefficient_derivatives",
    "dimensional_derivatives",
    "exact",
    "matrix_derivatives",
]
