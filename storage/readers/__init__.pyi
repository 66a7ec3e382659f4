from .any_format import prepare_reader, read_log
from .ulog_stream import UlogStream, following

__all__ = ["UlogStream", "following", "prepare_reader", "read_log"]
