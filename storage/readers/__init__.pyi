from .isolated import parsed_log, start_reader
from .worker import prepare_reader

__all__ = ["parsed_log", "prepare_reader", "start_reader"]
