"""The rows of the compiled simulation are named, so that a new one may stand anywhere."""

import ast

import pytest

from aerodb.simulation import engine, layout
from tests.support.paths import ROOT


@pytest.mark.parametrize("name", ["kernel", "integration"])
def test_no_row_is_a_bare_number(name: str) -> None:
    tree = ast.parse((ROOT / f"aerodb/simulation/{name}.py").read_text(encoding="utf-8"))
    bare = [
        ast.unparse(node)
        for node in ast.walk(tree)
        if isinstance(node, ast.Subscript)
        and not (isinstance(node.value, ast.Attribute) and node.value.attr == "shape")
        and any(isinstance(part, ast.Constant) for part in ast.walk(node.slice))
    ]
    assert bare == []


def test_rows_are_in_the_order_of_their_names() -> None:
    assert [layout.SURROUNDINGS[row] for row in layout.H] == list(layout.H._fields)
    assert (*layout.MOTION, *layout.LOADS) == layout.CHAN._fields
    assert [layout.MOTION[row] for row in layout.FEEDBACK_ROWS] == list(layout.FEEDBACK)
    assert set(layout.FURTHER_LOADS) < set(layout.SURROUNDINGS)
    assert (len(layout.SURROUNDINGS), len(layout.STATE)) == (layout.INPUTS, layout.EXTRA)
    assert set(engine._DEFAULTS) < set(layout.SURROUNDINGS)
