"""Examples in docstrings are true."""

import doctest
import importlib
import pkgutil
from importlib.util import find_spec
from types import ModuleType

import pytest

import aerodb


def examples() -> list[str]:
    """Modules with an example."""
    found = []
    for module in pkgutil.walk_packages(aerodb.__path__, "aerodb."):
        spec = None if module.name.endswith("__main__") else find_spec(module.name)
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


def test_there_are_examples_in_science_and_in_the_library() -> None:
    assert {"aerodb.support.identity", "aerodb.flows.library.evaluation"} <= set(examples())
