"""No decision and no number is read from a sentence: what is said is data first (`aerodb.remarks`).

Found are string methods, patterns and `"words" in` on anything that is named like something said.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Names of what is said in words.
SAID = {"because", "message", "note", "reason", "remark", "sentence"}
#: What reads words.
METHODS = {
    "startswith",
    "endswith",
    "partition",
    "rpartition",
    "removeprefix",
    "removesuffix",
    "split",
    "rsplit",
}
PATTERNS = {"match", "fullmatch", "search", "findall", "finditer"}
#: Where sentences are read all the same -> why.
ALLOWED = {
    "aerodb/remarks.py": "a clause of a summary is the sentence up to its colon",
    "aerodb/report/former_documents.py": "documents of earlier releases say no more",
    "aerodb/report/findings.py": "numbers that a page shows beside a sentence are left out of it",
    "aerodb/tracing/decision/axis_models.py": "a sentence goes on otherwise",
    "aerodb/loop/remarks.py": "where a note comes from is left out of a list of notes",
    "flows/web/work_pages.py": "a file's name stands beside what is wrong with it",
}


def _said(node: ast.AST) -> bool:
    """Whether an expression is named like something said: `row.reason`, `finding["because"]`."""
    if isinstance(node, ast.Name):
        return node.id in SAID
    if isinstance(node, ast.Attribute):
        return node.attr in SAID
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
        return node.slice.value in SAID
    return False


def readings(source: str) -> Iterator[int]:
    """Lines of a module in which words of something said are read."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            reads = node.args and node.func.attr in METHODS and _said(node.func.value)
            if reads or (node.func.attr in PATTERNS and any(map(_said, node.args))):
                yield node.lineno
        if (
            isinstance(node, ast.Compare)
            and isinstance(node.ops[0], ast.In | ast.NotIn)
            and _said(node.comparators[0])
        ):
            yield node.lineno


def test_no_sentence_is_read() -> None:
    found = {
        f"{path.relative_to(ROOT)}:{line}"
        for folder in ("aerodb", "tasks", "flows", "storage")
        for path in sorted((ROOT / folder).rglob("*.py"))
        if "migrations" not in path.parts and str(path.relative_to(ROOT)) not in ALLOWED
        for line in readings(path.read_text(encoding="utf-8"))
    }
    assert not found, "say it as a Remark, with kind, subjects and values"


def test_what_is_allowed_is_still_there() -> None:
    assert all(list(readings((ROOT / each).read_text(encoding="utf-8"))) for each in ALLOWED)


def test_readings_are_found() -> None:
    assert list(readings('row.reason.startswith("beside")\n')) == [1]
    assert list(readings('re.match("a", finding["because"])\n"b" in remark\n')) == [1, 2]
    assert not list(readings('name.startswith("delta_")\nkind in remark.kind\n'))
