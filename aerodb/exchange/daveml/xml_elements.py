"""DAVE-ML's XML: parsed without entities, external files or network; its elements, numbers and
texts.

A document type that only names the standard's DTD is normal in these files and is not followed; one
that declares anything itself is refused. DAVE-ML 2.0 is AIAA S-119; its elements:
https://daveml.org/DTDs/2p0/Ref.
"""

import math
import re
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from aerodb.errors import InputError, nearest

MAX_BYTES: Final = 100_000_000
MAX_ATTRIBUTE: Final = 10_000  # characters
MAX_DEPTH: Final = 250  # elements inside each other
ROOT: Final = "DAVEfunc"

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
_SEPARATORS = re.compile(r"[\s,;]+")


def read_root(xml: bytes, where: str) -> Any:
    """The element ``<DAVEfunc>``.

    Raises InputError for what is not such a file, declared entities, and sizes beyond the limits
    above.
    """
    if len(xml) > MAX_BYTES:
        raise InputError(f"{len(xml)} bytes of XML", where, f"at most {MAX_BYTES}")
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        dtd_validation=False,
        remove_pis=True,
    )
    try:
        root = etree.fromstring(xml, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise InputError(f"not valid XML: {error}", where) from None
    declared = root.getroottree().docinfo.internalDTD
    if declared is not None and (list(declared.iterentities()) or list(declared.iterelements())):
        raise InputError(
            "a document type with declarations of its own",
            where,
            "remove what stands between [ and ] of <!DOCTYPE",
        )
    _check_tree(root, where)
    if tag(root) != ROOT:
        raise InputError(f"root element <{tag(root)}>", where, f"a DAVE-ML file has <{ROOT}>")
    return root


def is_daveml(xml: bytes) -> bool:
    """Whether the first element of a file is DAVE-ML's, judged without parsing it."""
    start = re.search(
        rb"<(?![?!])(?:[\w.-]+:)?([\w.-]+)",
        re.sub(rb"<!--.*?-->", b"", xml[:1_000_000], flags=re.DOTALL),
    )
    return start is not None and start.group(1) == ROOT.encode()


def _check_tree(root: Any, where: str) -> None:
    pending = [(root, 1)]
    while pending:
        element, depth = pending.pop()
        if element.tag is etree.Entity:
            raise InputError(f"the entity {element.text}", where, "write what it stands for")
        if depth > MAX_DEPTH:
            raise InputError(f"more than {MAX_DEPTH} elements inside each other", where)
        for name, value in element.attrib.items() if isinstance(element.tag, str) else ():
            if len(value) > MAX_ATTRIBUTE:
                raise InputError(
                    f"{len(value)} characters in attribute '{name}' of <{tag(element)}>", where
                )
        pending.extend((child, depth + 1) for child in element)


def tag(element: Any) -> str:
    """Name of an element without its namespace."""
    return str(etree.QName(element).localname)


def children(element: Any) -> Iterator[Any]:
    """Child elements; comments are passed over."""
    return (child for child in element if isinstance(child.tag, str))


def find(element: Any, *tags: str) -> Any:
    """The first child with one of these names, or None."""
    return next((child for child in children(element) if tag(child) in tags), None)


def unsupported(element: Any, parent: str, where: str) -> InputError:
    """The error for an element that is not known: what is not understood is never left out
    silently."""
    return InputError(
        f"unsupported element <{tag(element)}> in {parent}",
        where,
        "its effect cannot be left out silently",
    )


def required(element: Any, attribute: str, where: str) -> str:
    """An attribute that must be there, without blanks around it."""
    value = (element.get(attribute) or "").strip()
    if not value:
        raise InputError(f"<{tag(element)}> without '{attribute}'", where)
    return value


def own_text(element: Any) -> str:
    """Text of an element; a comment inside it separates what stands before and after."""
    return " ".join([element.text or "", *(child.tail or "" for child in element)])


def plain(element: Any) -> str:
    """All text and attributes below an element in one line, for people: metadata is kept so."""
    if element is None:
        return ""
    parts = [f"{name}={value}" for name, value in element.attrib.items()]
    text = " ".join(own_text(element).split())
    parts += [text] if text else []
    for child in children(element):
        inside = plain(child)
        parts.append(
            inside
            if tag(child) == "description"
            else f"{tag(child)}: {inside}"
            if inside
            else tag(child)
        )
    return "; ".join(parts)


def number(text: str | None, where: str) -> float:
    """A finite number; Fortran's exponent letter D is one."""
    found = (text or "").strip()
    if _NUMBER.fullmatch(found) is None:
        raise InputError(f"'{found[:40]}' is not a number", where)
    value = float(found.replace("d", "e").replace("D", "e"))
    if not math.isfinite(value):
        raise InputError(f"'{found[:40]}' is too large", where)
    return value


def numbers(element: Any, where: str) -> NDArray[np.float64]:
    """Numbers of a list, separated by blanks, commas, semicolons, line ends and comments in any
    mixture."""
    words = [word for word in _SEPARATORS.split(own_text(element)) if word]
    if next(children(element), None) is not None:
        raise unsupported(next(children(element)), f"<{tag(element)}>", where)
    return np.array([number(word, where) for word in words])


def choice(element: Any, attribute: str, known: tuple[str, ...], where: str) -> str:
    """An attribute that takes one of few words; the first when it is absent."""
    value = (element.get(attribute) or known[0]).strip()
    if value not in known:
        raise InputError(f"{attribute}='{value}' of <{tag(element)}>", where, nearest(value, known))
    return value
