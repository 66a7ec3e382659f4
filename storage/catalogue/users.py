"""Users of a workspace: names, roles and hashes of their tokens, as events; the newest counts.

A token is 256 random bits, so its plain sha256 cannot be guessed: a slow or salted hash is for
words that people choose.
"""

from typing import get_args

import sqlalchemy as sa

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.ledger import Ledger
from aerodb.storage.catalogue.rows import UserRole, UserRow


class UserLedger(Ledger):
    """Catalogue queries about users."""

    def add_user(self, name: str, role: UserRole, token_sha256: str, *, by: str) -> UserRow:
        """Add a user, or give one another role and token; the token before no longer counts.
        InputError for a name or role (`UserRole`) that is not allowed, or a hash that is no
        sha256."""
        enc.checked(name, enc.USER_NAME, "the name of a user")
        enc.checked_key(token_sha256, "the hash of a token")
        if role not in get_args(UserRole):
            remedy = f"choose one of {', '.join(get_args(UserRole))}"
            raise InputError(f"unknown role {enc.shown(role)}", f"user {name}", remedy)
        self._add_user_event(name, by, kind="added", role=role, token_sha256=token_sha256)
        return self.user(name)

    def remove_user(self, name: str, *, by: str) -> None:
        """Remove a user: the token no longer counts. UnknownNameError when there is none. Table
        `user_events`."""
        self.user(name)
        self._add_user_event(name, by, kind="removed", role=None, token_sha256=None)

    def _add_user_event(self, name: str, by: str, **values: str | None) -> None:
        at, actor = enc.time_text(enc.now()), enc.plain_text(by)
        with self._database.writing() as connection:
            connection.execute(
                sa.insert(s.user_events).values({"name": name, "at_utc": at, "by": actor, **values})
            )

    def users(self) -> tuple[UserRow, ...]:
        """All users, by name."""
        c = s.user_events.c
        newest = sa.select(sa.func.max(c.sequence)).group_by(c.name)
        query = (
            sa.select(s.user_events)
            .where(c.sequence.in_(newest), c.kind == "added")
            .order_by(c.name)
        )
        with self._database.reading() as connection:
            rows = connection.execute(query).all()
        return tuple(
            UserRow(row.name, row.role, row.token_sha256, enc.time_of(row.at_utc), row.by)
            for row in rows
        )

    def user(self, name: str) -> UserRow:
        """Return one user of `users`; UnknownNameError, with the nearest name, when there is
        none."""
        users = {row.name: row for row in self.users()}
        if name not in users:
            remedy = nearest(name[:128], users) if users else "add one first: aerodb user add"
            raise UnknownNameError(f"unknown user {enc.shown(name)}", remedy=remedy)
        return users[name]
