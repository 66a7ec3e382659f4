from .lift_like import from_zero_lift, zero_lift_alpha

__all__ = [
    "from_zero_lift",
    "zero_lift_alpha",
]
