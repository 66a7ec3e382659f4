from .gauss_newton import search
from .multiple_shooting import multiple_shooting
from .output_error import output_error
from .sensitivities import acting

__all__ = [
    "acting",
    "multiple_shooting",
    "output_error",
    "search",
]
