"""Self-describing protobuf messages: the schema is a FileDescriptorSet, as defined by MCAP's
registry of encodings.

Every schema gets its own descriptor pool, because two logs, or two files of a log, may define the
same name differently.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from graphlib import TopologicalSorter
from typing import Any

from google.protobuf.descriptor import Descriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass


def protobuf_type(name: str, descriptors: bytes) -> Callable[[bytes], Message]:
    """Function that parses messages of type `name` (with its package), described by a serialized
    FileDescriptorSet.

    Raises protobuf's own errors (DecodeError, TypeError), KeyError for a missing type or imported
    file, and graphlib's CycleError for files that import each other.
    """
    files = {file.name: file for file in FileDescriptorSet.FromString(descriptors).file}
    pool = DescriptorPool()
    for file in TopologicalSorter(
        {name: file.dependency for name, file in files.items()}
    ).static_order():
        pool.Add(files[file])
    parse: Callable[[bytes], Message] = GetMessageClass(pool.FindMessageTypeByName(name)).FromString
    return parse


def protobuf_parts(value: Any) -> Iterable[tuple[str, Any]] | None:
    """Names and values in a message, maps by their keys; None if the value is neither a message nor
    a map.

    Unset fields with presence (submessages, ``optional``, ``oneof``) are left out; other fields
    have their default, which is never transmitted.
    """
    if isinstance(value, Message):
        return _parts(value)
    return value.items() if isinstance(value, dict) else None


def _parts(message: Message) -> Iterator[tuple[str, Any]]:
    kind = type(message)
    for name, has_presence, is_map in _fields(kind.DESCRIPTOR):
        if has_presence and not kind.HasField(message, name):
            continue
        value = getattr(message, name)
        yield name, {str(key): value[key] for key in sorted(value)} if is_map else value


@lru_cache(maxsize=256)
def _fields(descriptor: Descriptor) -> tuple[tuple[str, bool, bool], ...]:
    """Name of each field, whether it has presence, and whether it is a map."""
    return tuple((f.name, f.has_presence, _is_map(f.message_type)) for f in descriptor.fields)


def _is_map(kind: Descriptor | None) -> bool:
    return kind is not None and bool(kind.GetOptions().map_entry)
