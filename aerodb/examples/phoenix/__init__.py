"""The built-in example: a Phoenix-like vehicle with an INVENTED preflight database, flown by
simulation.

What a user would have is here as text: `vehicle.toml`, `preflight.toml`, `model.toml`. What really
flies is sealed in `truth`; `mission` flies it.
"""

from importlib.resources import files


def read_example(name: str) -> str:
    """Text of one of the example's files: ``vehicle.toml``, ``preflight.toml`` or
    ``model.toml``."""
    return (files(__name__) / name).read_text(encoding="utf-8")
