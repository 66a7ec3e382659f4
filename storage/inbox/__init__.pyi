from . import quarantined
from .folders import (
    Waiting,
    aside_key,
    keep_log,
    kept_path,
    look,
    look_again,
    may_settle,
    open_log,
    put_aside,
    sized,
)
from .outbox import post, waiting
from .quarantined import REASON, Quarantined, newest, put_back

__all__ = [
    "REASON",
    "Quarantined",
    "Waiting",
    "aside_key",
    "keep_log",
    "kept_path",
    "look",
    "look_again",
    "may_settle",
    "newest",
    "open_log",
    "post",
    "put_aside",
    "put_back",
    "quarantined",
    "sized",
    "waiting",
]
