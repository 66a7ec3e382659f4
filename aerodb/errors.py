"""Exceptions that say what is wrong, where, and what to do about it.

Each derives from the builtin exception that it specialises, so that callers who do not know this
package still catch the right type. The command line maps them to exit codes; nothing here knows
about that.
"""

import difflib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

#: Most mistakes of a file that are said at once: a screen of them.
_SAID: Final = 20


class AeroError(Exception):
    """Base of all errors of the package: a cause, a location and a remedy.

    Parameters
    ----------
    what : one clause: what is wrong.
    where : file, topic, time or key where it was found; may be empty.
    remedy : what the user can do about it; may be empty.
    """

    def __init__(self, what: str, where: str = "", remedy: str = "") -> None:
        self.what, self.where, self.remedy = what, where, remedy
        first = f"{where}: {what}" if where else what
        super().__init__("\n".join(line for line in (first, remedy) if line))

    @property
    def without_place(self) -> str:
        """Cause and remedy, where the place is known."""
        return "\n".join(line for line in (self.what, self.remedy) if line)

    def __reduce__(self) -> tuple[type["AeroError"], tuple[Any, ...]]:
        return type(self), (self.what, self.where, self.remedy)


class InputError(AeroError, ValueError):
    """Unusable log, vehicle, database or model file; nothing else has been changed."""


@dataclass(frozen=True)
class Question:
    """What is open about an input of a file: the question, the name of the input in the file, and
    the expressions proposed for it, each with the case in which it is right (may be empty)."""

    text: str
    name: str
    proposals: tuple[tuple[str, str], ...]

    @property
    def lines(self) -> tuple[str, ...]:
        """The question, and an indented option for each proposal.

        >>> Question("which sign?", "b", (("beta", "if like beta"), ("0", ""))).lines
        ('- which sign?', '  --bind b=beta   if like beta', '  --bind b=0')
        """
        options = (f"  --bind {self.name}={e}   {case}".rstrip() for e, case in self.proposals)
        return f"- {self.text}", *options


def together(errors: Sequence[InputError]) -> InputError:
    """Return one error that says all of these (at least one), each with its place and remedy.

    >>> print(together([InputError("no area", "[parts.tail]"), InputError("no x", "[parts.fin]")]))
    2 mistakes
    [parts.tail]: no area
    [parts.fin]: no x
    """
    if len(errors) == 1:
        return errors[0]
    more = [f"and {len(errors) - _SAID} more"] if len(errors) > _SAID else []
    told = [str(each).replace("\n", "; ") for each in errors[:_SAID]]
    return InputError(f"{len(errors)} mistakes", remedy="\n".join([*told, *more]))


class OpenQuestionsError(InputError):
    """Input that cannot be used before its user answers some questions: all of them at once."""

    def __init__(
        self, what: str, where: str = "", remedy: str = "", questions: Iterable[Question] = ()
    ) -> None:
        super().__init__(what, where, remedy)
        self.questions = tuple(questions)

    def __str__(self) -> str:
        return "\n".join((super().__str__(), *(x for each in self.questions for x in each.lines)))

    def __reduce__(self) -> tuple[type["AeroError"], tuple[Any, ...]]:
        return type(self), (self.what, self.where, self.remedy, self.questions)


class CalculationError(InputError):
    """A calculation failed on one input, in a way that it does not foresee; no other input is
    concerned."""


class UnknownNameError(AeroError, LookupError):
    """Unknown name of a vehicle, flight, version or channel."""


class StoreError(AeroError, OSError):
    """Failed write to disk or catalogue: full, read-only or locked; nothing is half written."""


class StoreBusyError(StoreError):
    """Failed write that may succeed later: the store is locked or temporarily out of reach."""


class GateRefusal(AeroError, RuntimeError):
    """Candidate version refused by the promotion gate, for one or more reasons: clauses."""

    def __init__(self, reasons: Iterable[str], where: str = "", remedy: str = "") -> None:
        self.reasons = tuple(reasons)
        super().__init__("; ".join(self.reasons), where, remedy)

    def __reduce__(self) -> tuple[type["AeroError"], tuple[Any, ...]]:
        return type(self), (self.reasons, self.where, self.remedy)


@contextmanager
def failing_alone(what: str, where: str, *, memory: bool = False) -> Iterator[None]:
    """Turn a calculation that fails on one input into a CalculationError, so that no other input is
    lost with it.

    what : the calculation. where : the input. memory : also where it gets no memory; only at the
    outermost level of a step, where nothing is stored, because there may be memory the next time.
    Errors of the disk, of threads, of the catalogue's database and of the orchestrator, and those
    that already say what to do, pass unchanged (`is_of_machinery`).
    """
    remedy = "report it with this log, as a fault of aerodb"
    cause: Exception
    try:
        yield
    except AeroError:
        raise
    except MemoryError as error:
        if not memory:
            raise
        cause, failed = error, "gets no memory"
        remedy = "free memory on this machine, then run it again"
    except OSError:
        raise
    except Exception as error:
        if str(error).startswith(_OF_THREADS) or is_of_machinery(error):
            raise
        cause, failed = error, "failed"
    else:
        return
    name = type(cause).__name__
    raise CalculationError(
        f"{what} {failed} ({name}: {cause})" if str(cause) else f"{what} {failed} ({name})",
        where,
        remedy,
    ) from cause


def is_of_machinery(error: BaseException) -> bool:
    """Return whether an exception comes from the catalogue's database or from the orchestrator: no
    input is at fault."""
    package, name = type(error).__module__.partition(".")[0], type(error).__name__
    return package in _ORCHESTRATION or (package in _DATABASE and name in _OUT_OF_REACH)


#: Starts of the RuntimeErrors of a machine or a pool that has no thread to give.
_OF_THREADS = ("can't start new thread", "cannot schedule new futures")
#: Packages of the orchestrator and of its connections.
_ORCHESTRATION = ("prefect", "distributed", "httpx", "httpcore", "anyio", "websockets")
#: Packages of the catalogue's database, and their errors that no value causes.
_DATABASE = ("sqlalchemy", "sqlite3", "psycopg")
_OUT_OF_REACH = ("OperationalError", "InterfaceError", "DisconnectionError", "TimeoutError")


def nearest(name: str, known: Iterable[str], most: int = 12) -> str:
    """Return the remedy of an InputError or UnknownNameError for a mistyped name: the closest known
    name, or the list of known names, at most `most` of them.

    >>> nearest("alhpa", ["alpha", "beta"])
    "did you mean 'alpha'?"
    >>> nearest("zzz", ["alpha", "beta"])
    'known names: alpha, beta'
    """
    names = sorted(set(known))
    if not names:
        return "there is none to name"
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.6) or difflib.get_close_matches(
        name.lower(), [n.lower() for n in names], n=1, cutoff=0.6
    )
    if close:
        match = next(n for n in names if n == close[0] or n.lower() == close[0])
        return f"did you mean '{match}'?"
    shown = ", ".join(names[:most]) + (", ..." if len(names) > most else "")
    return f"known names: {shown}"
