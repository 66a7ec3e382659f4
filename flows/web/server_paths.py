"""Paths of the server, which only those who may release are told."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from aerodb.tasks.actors import acts_as

#: An absolute path of this machine or of Windows; addresses such as ``/api/flights`` look alike.
_PATH: Final = re.compile(r"(?<![\w.:/\\])(?:[A-Za-z]:\\[^\s'\"<>;,]+|/[^\s'\"<>;,:]+)")


def for_visitor(content: Any) -> Any:
    """Return a document, or a text, as whoever sent the request may read it: all strings in it
    without paths of the server, unless they may release."""
    if acts_as("release"):
        return content
    if isinstance(content, str):
        return without_server_paths(content)
    if isinstance(content, Mapping):
        return {name: for_visitor(each) for name, each in content.items()}
    if isinstance(content, list):
        return [for_visitor(each) for each in content]
    return content


def without_server_paths(text: str) -> str:
    """Return a text in which each absolute path of the machine is the name of its file or folder.

    >>> without_server_paths("see /api/flights")
    'see /api/flights'
    """
    return _PATH.sub(_name, text)


def _name(found: re.Match[str]) -> str:
    path = found[0]
    if path.startswith("/"):
        first = path.split("/")[1]
        if not first or not Path("/", first).is_dir():
            return path
    return re.split(r"[/\\]", path.rstrip("/\\"))[-1]
