"""Aerodynamic effect templates: one module per effect that a database can lack or have wrong.

Each module states the effect, its model, the data needed to identify it, its believable size and
its source, and defines one `TEMPLATE`; `aerodb.effects.library` alone lists them. Most are made by
`template.per_axis` (one regressor on several axes) or `per_surface.per_surface` (one hypothesis per
control surface and axis). `lift_like` gives the angle of attack from zero lift (`zero_lift_alpha`,
`from_zero_lift`), which ground, Mach and dynamic-pressure effects share.

To add an effect: write a module like `pitch_damping`, add its `TEMPLATE` to `library.AERODYNAMIC`,
and its formula to tests/aerodb/effects/test_effects_recovery.py.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .lift_lag import with_lagged, with_lags
    from .lift_like import from_zero_lift, lift_curve, zero_lift_alpha
    from .model_parameter import PARAMETER

__getattr__, __dir__, __all__ = attach(__name__, __file__)
