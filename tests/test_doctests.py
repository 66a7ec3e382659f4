"""Examples in docstrings are true, also in the folders whose modules are imported under another name
than pytest would give them."""

import doctest
import importlib
import pkgutil
from types import ModuleType

import pytest

import aerodb.flows
import aerodb.storage
import aerodb.tasks


def examples() -> list[str]:
    """Modules of flows, tasks and storage with an example."""
    found = []
    for package in (aerodb.flows, aerodb.storage, aerodb.tasks):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            spec = importlib.util.find_spec(module.name)
            path = spec.origin if spec is not None else None
            if path is not None and path.endswith(".py") and ">>> " in _text(path):
                found.append(module.name)
    return found


def _text(path: str) -> str:
    with open(path, encoding="utf-8") as file:
        return file.read()


@pytest.mark.parametrize("name", examples())
def test_examples_are_true(name: str) -> None:
    module: ModuleType = importlib.import_module(name)
    result = doctest.testmod(module)
    assert result.attempted
    assert not result.failed


def test_there_are_examples_in_the_library() -> None:
    assert "aerodb.flows.library.evaluation" in examples()
