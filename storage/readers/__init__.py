"""Log readers: a log file of any known format as a `Recording`, without interpreting its fields.

`read_log` selects the reader: `ulog`, `mcap`, `dataflash` (ArduPilot), or `tabular` (CSV, MAT,
Parquet, text). Logs are untrusted: it is called in a process under limits
(`aerodb.tasks.workers.parsed_log`), for which `prepare_reader` imports and compiles what it needs.
Which field is which channel is decided afterwards by a mapping file (`aerodb.storage.mappings`).
`UlogStream` reads a ULog while it is being written, of which `following` gives the bytes.

Modules: `any_format`; `ulog`, `ulog_framing`, `ulog_kernels`,
`ulog_definitions`, `ulog_topics`, `ulog_stream`; `mcap`, `mcap_framing`, `mcap_messages`,
`mcap_protobuf`; `dataflash`, `dataflash_kernels`; `tabular`, `mat`, `text`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .any_format import prepare_reader, prepare_reader_of, read_log
    from .ulog_stream import UlogStream, following

__getattr__, __dir__, __all__ = attach(__name__, __file__)
