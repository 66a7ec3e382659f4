"""Models of aircraft that estimation methods are fitted to.

`conversion`: dimensional derivatives of linear models (`matrix_derivatives`) and coefficients, each
from the other, with covariance (`coefficient_derivatives`, `dimensional_derivatives`).
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
