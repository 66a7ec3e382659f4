"""Stall effects: separated flow with hysteresis as a state model and its gains.

`profiled` fits the shape of one family to stalled flights (`StallFlight`) and `cross_fitted` fits,
for each flight, the shape on all others (`stall_shape`). `hypotheses` turns the law of a shape into
hypotheses on lift, drag and pitching moment, and `stall_hysteresis.with_stall` adds an accepted one
to a database with its state model. `stall_loop` is the alternative in which the lift has a closed
static loop.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
