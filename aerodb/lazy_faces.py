"""Packages whose public names come from their modules when they are first asked for."""

import ast
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lazy_loader


def attach(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], Any]:
    """``__getattr__``, ``__dir__`` and ``__all__`` of a package: what its ``__init__.py`` imports
    from its own modules for type checkers (``if TYPE_CHECKING:``) is imported on first use.

    package, file : its ``__name__`` and ``__file__``.
    """
    tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    names: dict[str, list[str]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level == 1:
            names.setdefault(node.module or "", []).extend(alias.name for alias in node.names)
    modules = names.pop("", [])
    given: tuple[Callable[[str], Any], Callable[[], list[str]], Any]
    given = lazy_loader.attach(package, modules, names)
    return given
