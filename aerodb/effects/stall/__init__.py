"""Stall effects: separated flow with hysteresis as a state model and its gains.

`fit_shape` fits the shape of one family to stalled flights (`StallFlight`); `cross_fit_shapes` fits
for each flight the shape on all others (both in `stall_shape`). `stall_hypotheses` makes hypotheses
on lift, drag and pitching moment from the law of a shape, and `stall_hysteresis.with_stall` adds an
accepted one to a database together with its state model. `lift_hysteresis` is the alternative in
which the lift has a closed static loop.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from . import lift_hysteresis
    from .stall_hysteresis import stall_hypotheses, stall_regressors
    from .stall_shape import STALL_GAIN_BOUNDS, StallFlight, cross_fit_shapes, fit_shape

__getattr__, __dir__, __all__ = attach(__name__, __file__)
