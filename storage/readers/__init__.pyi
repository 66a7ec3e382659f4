from .isolated import Parsed, parsed_log, start_reader
from .ulog_stream import UlogStream, following
from .worker import prepare_reader

__all__ = ["Parsed", "UlogStream", "following", "parsed_log", "prepare_reader", "start_reader"]
