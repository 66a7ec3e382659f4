"""Work on an untrusted log in processes of their own, under the limits of the workspace.

What a log contains decides how much memory and time its parsing and each step on it take.
`parsed_log` parses a log in a fresh process, which has no secrets and ends afterwards; `confined`
runs a function of a per-flight step in one of a few processes that stay, one per concurrent caller.
Both are forks of one process that has imported what they need and has no threads; `start_workers`
starts it in advance. What breaks a limit is lost alone.

Modules: `beginning` and `pool` (this side), `server` (the process that forks, and the forks),
`parsing`; `memory_cache` (what a process remembers of flights), `freed_memory`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .beginning import FINDINGS, start_workers
    from .freed_memory import return_freed_memory
    from .memory_cache import cached, file_key
    from .parsing import Parsed, parsed_log
    from .pool import OverLimitError, confined

__getattr__, __dir__, __all__ = attach(__name__, __file__)
