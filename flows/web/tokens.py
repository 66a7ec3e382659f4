"""Tokens that requests carry: how they are sent, and how often an address may send a wrong one."""

import base64
import binascii
import ipaddress
import logging
import time
from collections import OrderedDict
from typing import Final, TypeVar

#: Wrong tokens of an address in a minute; further ones are not checked.
MOST_WRONG: Final = 10
#: Addresses and tokens that are remembered, so that strangers cannot fill the memory.
_REMEMBERED: Final = 10_000
_logger: Final = logging.getLogger(__name__)


def presented_token(header: str) -> str | None:
    """Return the token in an Authorization header: as bearer, or as anyone's password; None if
    there is none."""
    scheme, _, rest = header.partition(" ")
    given = rest.strip(" \t")
    if scheme.lower() == "bearer":
        return given or None
    if scheme.lower() != "basic":
        return None
    try:
        return base64.b64decode(given, validate=True).decode("utf-8").partition(":")[2] or None
    except (binascii.Error, UnicodeDecodeError):
        return None


class Attempts:
    """Wrong tokens of each address. Whoever has presented `MOST_WRONG` of them in a minute waits
    for its end before a further one is checked; tokens that were right before are not held up."""

    def __init__(self) -> None:
        self._wrong: OrderedDict[str, tuple[int, int]] = OrderedDict()
        self._right: OrderedDict[str, None] = OrderedDict()

    def may_try(self, address: str, hashed: str) -> bool:
        """Return whether a token is to be checked."""
        minute, wrong = self._wrong.get(_network(address), (0, 0))
        return hashed in self._right or minute != _minute() or wrong < MOST_WRONG

    def note(self, address: str, hashed: str, is_right: bool) -> None:
        """Note how a check ended."""
        if is_right:
            _remember(self._right, hashed, None)
            return
        self._right.pop(hashed, None)
        network = _network(address)
        minute, wrong = self._wrong.get(network, (0, 0))
        wrong = 1 if minute != _minute() else wrong + 1
        _remember(self._wrong, network, (_minute(), wrong))
        if wrong == MOST_WRONG:
            _logger.warning(
                "%d wrong tokens from %s within a minute: further ones wait", wrong, network
            )


_Value = TypeVar("_Value")


def _remember(where: OrderedDict[str, _Value], name: str, value: _Value) -> None:
    where[name] = value
    where.move_to_end(name)
    if len(where) > _REMEMBERED:
        where.popitem(last=False)


def _minute() -> int:
    return int(time.monotonic() // 60)


def _network(address: str) -> str:
    """Return an address; of IPv6 its network, within which one client has any number of them."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    return str(parsed) if parsed.version == 4 else str(ipaddress.ip_network((parsed, 64), False))
