"""Names for the arrays that the whole product passes on; their shapes stand in the docstrings."""

import numpy as np
from numpy.typing import NDArray

#: Numbers.
Array = NDArray[np.float64]
#: Which samples: True where one is meant.
Mask = NDArray[np.bool_]
#: Whole numbers: times in microseconds, counts, codes.
Integers = NDArray[np.int64]
