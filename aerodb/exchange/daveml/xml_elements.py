"""Parse DAVE-ML XML without entities, external files or network; read numbers and texts.

A document type that only names the standard's DTD is common in these files and is not followed. A
document type with declarations is refused.

Source: DAVE-ML 2.0, AIAA S-119; elements: https://daveml.org/DTDs/2p0/Ref.
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
MAX_DEPTH: Final = 250  # nested elements
ROOT: Final = "DAVEfunc"

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
_SEPARATORS = re.compile(r"[\s,;]+")


def read_root(xml: bytes, where: str) -> Any:
    """Return the element ``<DAVEfunc>``.

    Raises InputError for content that is not DAVE-ML, declared entities, and sizes beyond the
    limits above.
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
            "remove the part of <!DOCTYPE between [ and ]",
        )
    _check_tree(root, where)
    if tag(root) != ROOT:
        raise InputError(f"root element <{tag(root)}>", where, f"a DAVE-ML file has <{ROOT}>")
    return root


def is_daveml(xml: bytes) -> bool:
    """Return whether the first element is DAVE-ML's, without parsing the file."""
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
            raise InputError(f"the entity {element.text}", where, "write its replacement text")
        if depth > MAX_DEPTH:
            raise InputError(f"more than {MAX_DEPTH} nested elements", where)
        for name, value in element.attrib.items() if isinstance(element.tag, str) else ():
            if len(value) > MAX_ATTRIBUTE:
                raise InputError(
                    f"{len(value)} characters in attribute '{name}' of <{tag(element)}>", where
                )
        pending.extend((child, depth + 1) for child in element)


def tag(element: Any) -> str:
    """Return the name of an element without its namespace."""
    return str(etree.QName(element).localname)


def children(element: Any) -> Iterator[Any]:
    """Iterate over the child elements, without comments."""
    return (child for child in element if isinstance(child.tag, str))


def find(element: Any, *tags: str) -> Any:
    """Return the first child with one of these names, or None."""
    return next((child for child in children(element) if tag(child) in tags), None)


def unsupported(element: Any, parent: str, where: str) -> InputError:
    """Return the error for an unknown element.

    An element that is not understood is never left out silently.
    """
    return InputError(
        f"unsupported element <{tag(element)}> in {parent}",
        where,
        "its effect cannot be left out silently",
    )


def required(element: Any, attribute: str, where: str) -> str:
    """Return an attribute that must be present, stripped of blanks.

    Raises InputError where it is missing.
    """
    value = (element.get(attribute) or "").strip()
    if not value:
        raise InputError(f"<{tag(element)}> without '{attribute}'", where)
    return value


def own_text(element: Any) -> str:
    """Return the text of an element; a comment inside it separates the text around it."""
    return " ".join([element.text or "", *(child.tail or "" for child in element)])


def plain(element: Any) -> str:
    """Return all text and attributes below an element in one line, as readable metadata."""
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
    """Return a finite number; the exponent letter D of Fortran is accepted.

    Raises InputError for other text; the unit is the file's.
    """
    digits = (text or "").strip()
    if _NUMBER.fullmatch(digits) is None:
        raise InputError(f"'{digits[:40]}' is not a number", where)
    value = float(digits.replace("d", "e").replace("D", "e"))
    if not math.isfinite(value):
        raise InputError(f"'{digits[:40]}' is too large", where)
    return value


def numbers(element: Any, where: str) -> NDArray[np.float64]:
    """Return the numbers of a list.

    They are separated by any mixture of blanks, commas, semicolons, line ends and comments.

    Returns (n,). Raises InputError for an element inside the list, or a word that is no number.
    """
    words = [word for word in _SEPARATORS.split(own_text(element)) if word]
    if next(children(element), None) is not None:
        raise unsupported(next(children(element)), f"<{tag(element)}>", where)
    return np.array([number(word, where) for word in words])


def choice(element: Any, attribute: str, known: tuple[str, ...], where: str) -> str:
    """Return an attribute that takes one of `known` words; the first if it is absent.

    Raises InputError for another word.
    """
    value = (element.get(attribute) or known[0]).strip()
    if value not in known:
        raise InputError(f"{attribute}='{value}' of <{tag(element)}>", where, nearest(value, known))
    return value
