"""What to fly next: manoeuvres that determine parameters best, and steps to a wider envelope.

`design_manoeuvre` finds the manoeuvre, within limits, that determines parameters best
(`experiment`); `envelope_expansion` orders the test points on the way to a wider envelope.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
