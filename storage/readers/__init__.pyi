from .isolated import Parsed, parsed_log, start_reader
from .worker import prepare_reader

__all__ = ["Parsed", "parsed_log", "prepare_reader", "start_reader"]
