from .isolated import parsed_log, start_reader

__all__ = ["parsed_log", "start_reader"]
