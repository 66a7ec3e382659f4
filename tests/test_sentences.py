"""No decision and no number is read from a sentence: what is said is data first (`aerodb.remarks`).

Found are string methods, patterns and `"words" in` on anything that is named like something said,
and those that look for words, whatever they read.
"""

import ast
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Names of what is said in words.
SAID = {
    "because",
    "clause",
    "description",
    "detail",
    "message",
    "note",
    "reason",
    "remark",
    "remedy",
    "said",
    "says",
    "sentence",
    "what",
    "why",
    "words",
}
#: What reads words.
METHODS = {
    "count",
    "endswith",
    "find",
    "index",
    "partition",
    "removeprefix",
    "removesuffix",
    "rfind",
    "rpartition",
    "rsplit",
    "split",
    "startswith",
}
PATTERNS = {"findall", "finditer", "fullmatch", "match", "search", "sub"}
#: A word beside a space, or the marks between clauses.
WORDS = re.compile(r"[A-Za-z]{2,}[,;:)]? | [(]?[A-Za-z]{2,}|^\W* $|^ \W*$")
#: Where words are read all the same -> why.
ALLOWED = {
    # the product's own words, in documents that say no more
    "aerodb/report/former_documents.py": "documents of earlier releases: their remarks",
    "aerodb/exchange/increment_notes.py": "documents of earlier releases: notes of increments",
    "aerodb/coefficients/inputs.py": "stored databases: inputs held at zero",
    "aerodb/exchange/daveml/names.py": "stored databases: units of inputs; and units of files",
    "aerodb/exchange/jsbsim/properties.py": "stored databases: properties of inputs",
    "storage/catalogue/postgresql.py": "the comment on a database that names its workspace",
    # text for the eye: nothing is decided by it
    "aerodb/report/figures.py": "a flight's label without its date, where there is no room",
    "aerodb/report/terms.py": "names of parameters",
    "aerodb/report/glossary.py": "names of effects, for their ids in a sentence",
    "aerodb/estimation/regression/equation_error.py": "the first sign of a formula",
    "aerodb/simulation/modes.py": "names of modes",
    "flows/demo.py": "names of parameters",
    "flows/cli/output.py": "lines of a terminal with a command, which are not divided",
    # what others write
    "aerodb/errors.py": "Python's messages",
    "aerodb/exchange/aero_codes/avl.py": "the output of AVL",
    "aerodb/exchange/aero_codes/datcom.py": "the output of Datcom",
    "aerodb/increments/spline_terms.py": "model files",
    "aerodb/logs/clocks.py": "names of fields of logs",
    "aerodb/logs/field_names.py": "names of fields of logs",
    "aerodb/logs/vehicle_draft.py": "the template of a vehicle file",
    "aerodb/support/strict.py": "pydantic's messages",
    "aerodb/support/toml.py": "tomllib's messages",
    "aerodb/suspicions/surfaces.py": "the sign convention of a vehicle file",
    "storage/files/parquet.py": "messages of pyarrow",
    "flows/processes.py": "the environment of a process",
    "flows/run.py": "Prefect's messages",
    "flows/web/tokens.py": "HTTP headers",
    "storage/database_errors.py": "messages of databases",
    "storage/files/objects.py": "messages of object stores",
    "storage/readers/dataflash.py": "logs",
    "tasks/workers/server.py": "Python's messages",
}


def _said(node: ast.AST) -> bool:
    """Whether an expression is named like something said: `row.reason`, `finding["because"]`."""
    if isinstance(node, ast.Name):
        return node.id in SAID
    if isinstance(node, ast.Attribute):
        return node.attr in SAID
    if isinstance(node, ast.Subscript):
        return _said(node.value) or (
            isinstance(node.slice, ast.Constant) and node.slice.value in SAID
        )
    if isinstance(node, ast.Call):  # what changes or takes the text: `str(remark)`, `note.lower()`
        within = [*node.args[:1]] if isinstance(node.func, ast.Name) else [node.func]
        return any(
            _said(each.value if isinstance(each, ast.Attribute) else each) for each in within
        )
    return False


def _texts(node: ast.AST, constants: Mapping[str, list[str]]) -> list[str]:
    """The texts in an expression, those of the module's constants included."""
    return [
        text
        for each in ast.walk(node)
        for text in (
            [each.value]
            if isinstance(each, ast.Constant) and isinstance(each.value, str)
            else constants.get(each.id, [])
            if isinstance(each, ast.Name)
            else []
        )
    ]


def _constants(tree: ast.Module) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for each in tree.body:
        names = each.targets if isinstance(each, ast.Assign) else [getattr(each, "target", None)]
        for name in names:
            if isinstance(name, ast.Name) and getattr(each, "value", None) is not None:
                found[name.id] = _texts(each.value, {})  # type: ignore[attr-defined]
    return found


def readings(source: str) -> Iterator[int]:
    """Lines of a module in which words are read."""
    tree = ast.parse(source)
    constants = _constants(tree)

    def looks_for_words(node: ast.AST) -> bool:
        return any(WORDS.search(text) for text in _texts(node, constants))

    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.args:
            method, of = node.func.attr, node.func.value
            if method in METHODS and (_said(of) or looks_for_words(node.args[0])):
                yield node.lineno
            if method in PATTERNS and (any(map(_said, node.args)) or looks_for_words(of)):
                yield node.lineno
        if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.In | ast.NotIn):
            words = isinstance(node.left, ast.JoinedStr | ast.Constant | ast.Name)
            of = node.comparators[0]
            collection = isinstance(of, ast.Tuple | ast.List | ast.Set | ast.Dict)
            if words and not collection and (_said(of) or looks_for_words(node.left)):
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
    assert list(readings('row.reason.startswith("a")\n')) == [1]
    assert list(readings('re.match("a", finding["because"])\n"b" in remark\n')) == [1, 2]
    assert list(readings('str(note).split()[0].rpartition(":")\n'))
    by_words = """
_NEEDED = re.compile(f"would need {_NUMBER}")
_NEEDED.search(text)
"the gate" in text
text.partition("; ")
any("left out" in each for each in entry["texts"])
"""
    assert list(readings(by_words)) == [3, 4, 5, 6]
    assert not list(
        readings('name.startswith("delta_")\nkind in remark.kind\nx in ("no word", "")\n')
    )
