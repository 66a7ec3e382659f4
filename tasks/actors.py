"""Who acts: a user of the console, or of the operating system, and what the role allows.

Once a workspace has users, flows ask for a role: the owner of the workspace folder may do
everything, others what their role allows. On the command line this keeps honest people to their
roles; whoever can write the folder's files can also write without aerodb.
"""

import hashlib
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, get_args

from aerodb.errors import InputError
from aerodb.storage.catalogue import UserRole

if TYPE_CHECKING:
    from aerodb.storage.catalogue import Catalogue
    from aerodb.storage.workspace import Workspace

try:
    import pwd
except ImportError:  # a system without user ids
    pwd = None  # type: ignore[assignment]

#: From the least to the most.
_ROLES: Final = get_args(UserRole)
_ACTING: Final[ContextVar["Actor | None"]] = ContextVar("acting", default=None)


class NotAllowedError(InputError):
    """The role of the user does not allow this."""


@dataclass(frozen=True)
class Actor:
    """Who acts, and the role."""

    name: str
    role: UserRole


def acting() -> Actor | None:
    """Return who acts in place of the operating system's user; None if nobody does."""
    return _ACTING.get()


@contextmanager
def acting_as(actor: Actor | None) -> Iterator[None]:
    """Context manager in which `actor` acts, in place of the operating system's user."""
    token = _ACTING.set(actor)
    try:
        yield
    finally:
        _ACTING.reset(token)


def user() -> str:
    """Return the name of who acts: outside the console, the operating system's name of this
    process's user id. The environment, which anybody may set, is not asked."""
    actor = _ACTING.get()
    return actor.name if actor is not None else system_user()


def system_user() -> str:
    """Return the operating system's name of this process's user id, whoever acts."""
    if pwd is None:
        return os.environ.get("USERNAME", "unknown")
    number = os.getuid()
    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return f"uid {number}"


def require_role(workspace: "Workspace", catalogue: "Catalogue", role: UserRole, what: str) -> None:
    """Raise NotAllowedError unless who acts has at least `role`; `what` is to be done."""
    actor = _ACTING.get()
    if actor is None:
        users = catalogue.users()
        if not users or _owns(workspace):
            return
        known = {row.name: row.role for row in users}
        held = known.get(system_user())
    else:
        held = actor.role
    if held is None or _ROLES.index(held) < _ROLES.index(role):
        has = f"has the role {held}" if held else "is no user of this workspace"
        raise NotAllowedError(
            f"{what} requires the role {role}; {user()} {has}",
            str(workspace.root),
            f"ask the owner of the workspace: aerodb user add {user()} --role {role}",
        )


def acts_as(role: UserRole) -> bool:
    """Return whether who acts in place of the operating system's user has at least `role`, in the
    order of `UserRole`; False, and no error, if nobody does."""
    actor = _ACTING.get()
    return actor is not None and _ROLES.index(actor.role) >= _ROLES.index(role)


def _owns(workspace: "Workspace") -> bool:
    return pwd is None or workspace.root.stat().st_uid == os.getuid()


def new_token() -> str:
    """Return a token: 256 random bits as text."""
    return secrets.token_urlsafe(32)


def hash_of_token(token: str) -> str:
    """Return the sha256 that is stored of a token, as `Catalogue.users` has it; no token is
    refused."""
    return hashlib.sha256(token.encode("utf-8", "surrogatepass")).hexdigest()
