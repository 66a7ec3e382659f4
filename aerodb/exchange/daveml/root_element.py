"""The root element of a DAVE-ML file.

A document type that only names the standard's DTD is common in these files and is not followed. A
document type with declarations is refused.

Source: DAVE-ML 2.0, AIAA S-119; elements: https://daveml.org/DTDs/2p0/Ref.
"""

import re
from typing import Any, Final

from lxml import etree

from aerodb.errors import InputError
from aerodb.exchange.xml_elements import parsed, tag

_MAX_BYTES: Final = 100_000_000
_MAX_ATTRIBUTE: Final = 10_000  # characters
_MAX_ATTRIBUTES: Final = 100  # of one element: looking at all takes time as their number squared
_MAX_DEPTH: Final = 250  # nested elements
_ROOT: Final = "DAVEfunc"


def read_root(xml: bytes, where: str) -> Any:
    """Return the element ``<DAVEfunc>`` (DAVE-ML 2.0, AIAA S-119; at most `_MAX_BYTES` [bytes]).

    Raises InputError for content that is not DAVE-ML, declared entities, and sizes beyond the
    limits above.
    """
    root = parsed(xml, where, _MAX_BYTES)
    declared = root.getroottree().docinfo.internalDTD
    if declared is not None and (list(declared.iterentities()) or list(declared.iterelements())):
        raise InputError(
            "a document type with declarations of its own",
            where,
            "remove the part of <!DOCTYPE between [ and ]",
        )
    _check_tree(root, where)
    if tag(root) != _ROOT:
        raise InputError(f"root element <{tag(root)}>", where, f"a DAVE-ML file has <{_ROOT}>")
    return root


def is_daveml(xml: bytes) -> bool:
    """Return whether the first element is DAVE-ML's, without parsing the file."""
    start = re.search(
        rb"<(?![?!])(?:[\w.-]+:)?([\w.-]+)",
        re.sub(rb"<!--.*?-->", b"", xml[:1_000_000], flags=re.DOTALL),
    )
    return start is not None and start.group(1) == _ROOT.encode()


def _check_tree(root: Any, where: str) -> None:
    pending = [(root, 1)]
    while pending:
        element, depth = pending.pop()
        if element.tag is etree.Entity:
            raise InputError(f"the entity {element.text}", where, "write its replacement text")
        if depth > _MAX_DEPTH:
            raise InputError(f"more than {_MAX_DEPTH} nested elements", where)
        if isinstance(element.tag, str) and len(element.attrib) > _MAX_ATTRIBUTES:
            raise InputError(f"{len(element.attrib)} attributes of <{tag(element)}>", where)
        for name, value in element.attrib.items() if isinstance(element.tag, str) else ():
            if len(value) > _MAX_ATTRIBUTE:
                raise InputError(
                    f"{len(value)} characters in attribute '{name}' of <{tag(element)}>", where
                )
        pending.extend((child, depth + 1) for child in element)
