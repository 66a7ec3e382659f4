"""Stall effects: separated flow with hysteresis as a state model and its gains.

`fit_shape` fits the shape of one family to stalled flights (`StallFlight`); `cross_fit_shapes` fits
for each flight the shape on all others (both in `stall_shape`). `stall_hypotheses` makes hypotheses
on lift, drag and pitching moment from the law of a shape, and `stall_hysteresis.with_stall` adds an
accepted one to a database together with its state model. `lift_hysteresis` is the alternative in
which the lift has a closed static loop.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
