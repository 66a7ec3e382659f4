"""Errors that say what is wrong, where, and what to do about it.

Each subclasses the builtin that it specialises, so that callers who know nothing of this package
still catch the right thing. The command line maps them to exit codes; nothing here knows about
that.
"""

import difflib
from collections.abc import Iterable


class AeroError(Exception):
    """An error with a place and a remedy.

    Parameters
    ----------
    what : one clause, what is wrong.
    where : file, topic, time, key: where it was seen; may be empty.
    remedy : what the reader can do about it; may be empty.
    """

    def __init__(self, what: str, where: str = "", remedy: str = "") -> None:
        self.what, self.where, self.remedy = what, where, remedy
        first = f"{where}: {what}" if where else what
        super().__init__("\n".join(line for line in (first, remedy) if line))

    def __reduce__(self) -> tuple[type["AeroError"], tuple[str, str, str]]:
        return type(self), (self.what, self.where, self.remedy)


class InputError(AeroError, ValueError):
    """A log, vehicle, database or model file that cannot be used; nothing else has been changed."""


class UnknownNameError(AeroError, LookupError):
    """A name that nothing answers to: vehicle, flight, version, channel."""


class StoreError(AeroError, OSError):
    """The disk or the catalogue cannot take what is written now: full, read-only, or held by
    another; nothing is half there."""


class StoreBusyError(StoreError):
    """The same for a reason that may pass by itself: it is held by another, or out of reach for a
    moment."""


class GateRefusal(AeroError, RuntimeError):
    """The promotion gate said no."""


def nearest(name: str, known: Iterable[str]) -> str:
    """The remedy line for a mistyped name.

    >>> nearest("alhpa", ["alpha", "beta"])
    "did you mean 'alpha'?"
    >>> nearest("zzz", ["alpha", "beta"])
    'known names: alpha, beta'
    """
    names = sorted(set(known))
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.6) or difflib.get_close_matches(
        name.lower(), [n.lower() for n in names], n=1, cutoff=0.6
    )
    if close:
        match = next(n for n in names if n == close[0] or n.lower() == close[0])
        return f"did you mean '{match}'?"
    shown = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return f"known names: {shown}"
