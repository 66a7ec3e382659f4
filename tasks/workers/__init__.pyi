from .freed_memory import return_freed_memory
from .memory_cache import cached, clear_cache, file_key
from .parsing import Parsed, parsed_log
from .pool import OverLimitError, confined, start_workers

__all__ = [
    "OverLimitError",
    "Parsed",
    "cached",
    "clear_cache",
    "confined",
    "file_key",
    "parsed_log",
    "return_freed_memory",
    "start_workers",
]
