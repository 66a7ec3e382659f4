"""Type names of arrays; shapes are stated in the docstrings of the functions that use them."""

import numpy as np
from numpy.typing import NDArray

#: Real numbers.
Array = NDArray[np.float64]
#: Selected samples: True where a sample is selected.
Mask = NDArray[np.bool_]
#: Whole numbers: times in microseconds, counts, codes.
Integers = NDArray[np.int64]
