"""Readers: a log file of any known format as a `Recording`, just as it is. What it means is decided
by a mapping.

`read_log` finds the reader for a file: ULog, MCAP, or a table (CSV, MAT, Parquet, text). Logs from
outside are parsed by another process under limits (`parsed_log`): it answers with the topics as
files.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
