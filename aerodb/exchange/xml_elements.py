"""Parse XML without entities, external files or network; read numbers and texts of elements."""

import math
import re
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from aerodb.errors import InputError, nearest

_SHOWN: Final = 80  # characters
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
_SEPARATORS = re.compile(r"[\s,;]+")


def parsed(xml: bytes, where: str, most_bytes: int, remove_comments: bool = False) -> Any:
    """Return the root element; processing instructions are left out, and entities not expanded.

    Raises InputError for content that is not XML, and for more than `most_bytes`. The parser itself
    refuses nesting beyond 256 levels.
    """
    if len(xml) > most_bytes:
        raise InputError(f"{len(xml)} bytes of XML", where, f"at most {most_bytes}")
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        remove_comments=remove_comments,
        remove_pis=True,
    )
    try:
        return etree.fromstring(xml, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise InputError(f"not valid XML: {shortened(str(error))}", where) from None


def shortened(text: str | None) -> str:
    """Return text of a file for messages: one line of limited length."""
    line = " ".join((text or "").split())
    return line if len(line) <= _SHOWN else f"{line[:_SHOWN]}..."


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

    An element that is not understood is never left out silently: its caller raises this InputError.
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
