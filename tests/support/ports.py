"""Ports for servers of tests that are told theirs before they start."""

import random
import socket

#: Below the ports that systems give to outgoing connections: one of those could take it between the
#: look and the server's start.
_FIRST, _LAST = 20_000, 32_000


def free_port() -> int:
    """A port of the loopback interface that nobody has, at random: two processes that ask at the
    same moment get two."""
    for port in random.SystemRandom().sample(range(_FIRST, _LAST), 100):
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        return port
    raise RuntimeError(f"none of a hundred ports from {_FIRST} to {_LAST} is free")
