"""The page of thresholds holds what the code does, and a constant is varied where it is read."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from tests.campaigns.constants import NumericConstant, numeric_constants, scaled
from tests.campaigns.thresholds import PAGE, deciding, differences, page, rows

WRITE = "run `python -m tests.campaigns.thresholds --write`"
MODULE = '''"""A module."""

#: Longest wait [s].
LONGEST = 4.0
#: Fewest of them.
FEWEST = 3
#: Least and largest.
RATIOS = (0.5, 2.0)
NAMES = ("a", "b")
_DERIVED = max(1.0, 2.0)


def waits(seconds: float) -> bool:
    return seconds > LONGEST


def enough(count: int) -> bool:
    return count >= FEWEST
'''


@pytest.fixture
def made(tmp_path: Path) -> tuple[NumericConstant, ...]:
    (tmp_path / "aerodb").mkdir()
    (tmp_path / "aerodb" / "__init__.py").touch()
    (tmp_path / "aerodb" / "made.py").write_text(MODULE)
    return numeric_constants(tmp_path, ["aerodb.made"])


def test_the_page_lists_every_constant_with_its_value() -> None:
    held = set(rows(PAGE.read_text(encoding="utf-8")))
    now = {(each.id, each.source.replace("|", "\\|")) for each in deciding()}
    assert held == now, WRITE


def test_every_constant_says_what_it_is() -> None:
    assert [each.id for each in deciding() if not each.comment] == []


def test_constants_are_found_with_unit_and_reason(made: tuple[NumericConstant, ...]) -> None:
    assert [(each.name, each.source, each.unit) for each in made] == [
        ("LONGEST", "4.0", "s"),
        ("FEWEST", "3", ""),
        ("RATIOS", "(0.5, 2.0)", ""),
    ]
    assert made[0].comment == "Longest wait [s]."


@pytest.mark.parametrize(
    ("source", "factor", "value"),
    [
        ("4.0", 0.8, 3.2),
        ("-0.5", 1.25, -0.625),
        ("4.0 * 2", 1.25, 10.0),
        ("3", 0.8, 2),
        ("3", 1.25, 4),
        ("20", 1.25, 25),
        ("(0.5, 2.0)", 0.8, (0.4, 1.6)),
        ("{'V': 1.0, 'kind': 'wind'}", 1.25, {"V": 1.25, "kind": "wind"}),
        ("dict.fromkeys('pq', 0.5)", 0.8, {"p": 0.4, "q": 0.4}),
    ],
)
def test_a_constant_is_scaled_as_a_whole(source: str, factor: float, value: object) -> None:
    tree = ast.Expression(scaled(ast.parse(source, mode="eval").body, factor))
    assert eval(compile(ast.fix_missing_locations(tree), "", "eval")) == pytest.approx(value)


def _run(folder: Path, text: str) -> str:
    """What a process prints whose product is the made module."""
    begin = f"import sys; sys.path[:0] = [{str(Path(__file__).parents[2])!r}, {str(folder)!r}]\n"
    given = (
        "import importlib.util, pathlib\n"
        "place = pathlib.Path(sys.path[0]) / 'tests/campaigns/constants.py'\n"
        "spec = importlib.util.spec_from_file_location('constants', place)\n"
        "constants = importlib.util.module_from_spec(spec)\n"
        "sys.modules['constants'] = constants; spec.loader.exec_module(constants)\n"
        f"root = pathlib.Path({str(folder)!r}); sys.path[0] = str(root)\n"
        "listed = constants.numeric_constants(root, ['aerodb.made'])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", begin + given + text], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_a_constant_is_changed_while_it_is_imported(
    made: tuple[NumericConstant, ...], tmp_path: Path
) -> None:
    text = (
        "constants.change_on_import(listed[0], 1.25)\n"
        "import aerodb.made as made\n"
        "print(made.LONGEST, made.waits(4.5), made.waits(5.5), made.FEWEST)\n"
    )
    assert _run(tmp_path, text) == "5.0 False True 3"


def test_constants_that_are_read_are_reported(
    made: tuple[NumericConstant, ...], tmp_path: Path
) -> None:
    text = (
        "seen = constants.report_on_import(root, listed)\n"
        "import aerodb.made as made\n"
        "made.waits(1.0); print(sorted(seen)); seen.clear(); made.enough(2); print(sorted(seen))\n"
    )
    assert _run(tmp_path, text).splitlines() == ["['made.LONGEST']", "['made.FEWEST']"]


def test_differences_count_decisions_and_values() -> None:
    before = {"a": {"verdict": "good", "rms": 2.0}, "b": {"verdict": "limited", "said": "yes"}}
    after = {"a": {"verdict": "limited", "rms": 3.0}, "b": {"verdict": "limited"}}
    changed, total, largest, which = differences(before, after)
    assert (changed, total, largest) == (2, 3, 0.5)
    assert which == ["a: verdict: good -> limited", "b: said: yes -> None"]


def test_a_page_keeps_what_was_not_run_since(made: tuple[NumericConstant, ...]) -> None:
    lines = [
        {"constant": "made.LONGEST", "source": "4.0", "factor": factor, "cases": 5,
         "changed": 1, "decisions": 9, "value": 0.0, "commit": "abc"}
        for factor in (0.8, 1.25)
    ]  # fmt: skip
    made = tuple(
        NumericConstant(f"aerodb.support.{each.name}", "X", each.source, each.unit, each.comment)
        for each in made
    )
    lines = [{**line, "constant": made[0].id} for line in lines]
    first = page(lines, made, "")
    assert rows(first)[made[0].id, "4.0"] == ("5", "1 of 9", "1 of 9")
    assert rows(first)[made[1].id, "3"] == ("", "not run", "not run")
    again = page([], made, first)
    assert rows(again) == rows(first)
    assert "commit abc." in again
