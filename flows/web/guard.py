"""The names and addresses of the console, and its own token."""

import hashlib
import hmac
import ipaddress
import os
import secrets
import socket
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

from aerodb.errors import InputError
from aerodb.storage.workspace_settings import TOKEN_VARIABLE, ServeSettings, checked_token
from aerodb.tasks.actors import new_token


@dataclass(frozen=True)
class Guard:
    """Rules for access.

    names : host names of the console. any_address : whether any IP address of the machine is
    accepted as well. token : that admits to everything (empty: only tokens of users count).
    is_made : whether it was made for this console, and nobody knows it yet. key : signs the tokens
    of changes.
    """

    names: frozenset[str]
    any_address: bool
    token: str
    is_made: bool
    key: bytes

    def knows(self, host: str) -> bool:
        """Return whether a Host header names this console, whatever its port."""
        name = _name_of(host)
        if name in self.names:
            return True
        try:
            return self.any_address and bool(ipaddress.ip_address(name))
        except ValueError:
            return False

    def admits(self, presented: str) -> bool:
        """Return whether a presented token is that of this console."""
        return bool(self.token) and hmac.compare_digest(
            presented.encode("utf-8", "replace"), self.token.encode()
        )

    def csrf_token(self, session: str, name: str) -> str:
        """Return the token of changes for a session of the user `name`: no other user's fits."""
        signed = f"{session}\0{name}".encode("utf-8", "replace")
        return hmac.new(self.key, signed, hashlib.sha256).hexdigest()


def guard_of(
    host: str,
    port: int,
    known_as: Iterable[str] = (),
    environment: Mapping[str, str] | None = None,
    has_users: bool = False,
) -> Guard:
    """Return the guard for `host`, with a token of its own if there are neither one of the
    environment nor users; InputError if others can reach it then."""
    serve = ServeSettings(host=host, port=port)
    variables = dict(os.environ if environment is None else environment)
    try:
        has_token = bool(variables.get(TOKEN_VARIABLE)) or not has_users
        token = checked_token(serve, variables) if has_token else ""
    except InputError as error:
        raise InputError(
            error.what, "aerodb web --host", error.remedy.replace("serve.host", "--host")
        ) from error
    names = {
        "localhost",
        "127.0.0.1",
        "::1",
        _name_of(host),
        *(_name_of(name) for name in known_as),
    }
    if not serve.loopback:
        names |= {socket.gethostname().lower(), socket.getfqdn().lower()}
    is_made = not (token or has_users)
    token = new_token() if is_made else token
    any_address, key = host in ("0.0.0.0", "::"), secrets.token_bytes(32)
    return Guard(frozenset(names - {""}), any_address, token, is_made, key)


def _name_of(host: str) -> str:
    """Return the name or address in a Host header, without its port; empty if it is invalid."""
    if any(c in host for c in "/@\\ "):
        return ""
    text = f"[{host}]" if host.count(":") > 1 and not host.startswith("[") else host
    try:
        return (urlsplit(f"//{text}").hostname or "").rstrip(".").lower()
    except ValueError:
        return ""
