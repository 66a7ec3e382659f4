"""The built-in example: simulated flights of a Phoenix-like vehicle with INVENTED aerodynamics.

`read_example` gives what a user would have, as text: ``vehicle.toml``, ``preflight.toml`` (the
preflight database) and ``model.toml`` (declared increments).

``legs.toml`` is the landing gear that flies, also invented, which the preflight database lacks.

`mission.fly` simulates a campaign and returns its logs (`instruments` has the logged topics). The
flights use the true aerodynamics of `truth`, which the product never reads: only `mission` and the
demo import it. `preflight` has the formulas behind ``preflight.toml``.

The real vehicle is that of "Data Analysis of Phoenix Reusable Launch Vehicle Demonstrator Flight
Test", which the modules of this package call the Phoenix paper; it is in the references of
docs/method/tracing.md.
"""

from importlib.resources import files


def read_example(name: str) -> str:
    """Return the text of one of the example's files.

    name : ``vehicle.toml``, ``preflight.toml``, ``model.toml`` or ``legs.toml``.
    """
    return (files(__name__) / name).read_text(encoding="utf-8")
