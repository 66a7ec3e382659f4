"""What `make lint` checks of the words that people read: short sentences, no private words.

Read are messages in Python (the docstrings of commands are their help), the templates of the
console and of reports, and the documents.
"""

import ast
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Final

from tests.support.paths import ROOT

#: Words of a sentence, at most.
LONGEST: Final = 25
#: Words of ours alone -> what to say instead.
PRIVATE: Final[Mapping[str, str]] = {
    r"vot(?:e|es|ed|ing)": "the estimate of a flight",
    r"rivals?": "another explanation",
    r"grams?": "normal equations",
    r"linear sets?": "the linear terms",
    r"(?:library|was) frozen": "the list of effects was fixed before",
    r"per table nodes?": "at breakpoints of tables",
    r"linked events?": "events",
    r"moves of names": "releases and rollbacks",
    r"what hangs on (?:it|them|each)": "what it changes",
    r"the air moved": "turbulence",
    r"sealed envelopes?": "hidden errors",
    r"(?<!flight )envelopes?": "the flown range",
    r"(?:another|of the|in the|whole) library": "the list of effects",
    r"excess (?:held-out )?errors?": "the error beyond the noise floor",
}
#: Where words of `PRIVATE` may stand -> why.
EXPLAINED: Final[Mapping[str, str]] = {
    "docs/method/": "methods define their terms",
    "docs/evidence/": "and measure them",
    "docs/decisions/": "records of decisions keep the words of their time",
    "docs/reference/": "names of fields, and terms beside their definitions",
    "aerodb/report/former_documents.py": "words of earlier releases",
    "storage/upkeep/": "what `verify --json` counts: names do not change",
}
#: Who reads what.
CODE: Final = ("aerodb", "tasks", "flows", "storage")
TEMPLATES: Final = ("flows/web/templates/*.html", "aerodb/report/templates/*.html")
DOCUMENTS: Final = (
    "*.md",
    "docs/*.md",
    "docs/*/*.md",
    "flows/deploy/*.md",
)
#: Not read -> why.
SKIPPED: Final[Mapping[str, str]] = {
    "CHANGELOG.md": "what was said of a release is not changed afterwards",
    "docs/reference/benchmarks.md": "rows written by `make bench`",
    "storage/migrations": "SQL",
    "flows/cli/known_names.py": "lists of names",
}
#: The kind of a fault of length.
LONG: Final = f"more than {LONGEST} words"


@dataclass(frozen=True)
class Fault:
    """A sentence that people should not have to read: where, and what is wrong with it."""

    path: str
    line: int
    kind: str
    text: str

    def __str__(self) -> str:
        shown = self.text if len(self.text) < 300 else f"{self.text[:300]} ..."
        return f"{self.path}:{self.line}: {self.kind}: {shown}"


#: The end of a sentence; not the stop of an abbreviation or of a number.
_END = re.compile(r"(?<!e\.g)(?<!i\.e)(?<! vs)(?<!Fig)(?<! no)[.!?…][\"')”]*\s+(?=\S)|\n\s*\n")
_WORD = re.compile(r"[A-Za-z{][\w'’}-]*|\d[\w.,%-]*")
_MARKUP = re.compile(r"`[^`]*`|\$[^$]*\$")
#: A number, with its error and its unit.
_NUMBER = r"(?:\{\}|[-−]?\d*\.?\d+)"
_UNIT = r"m/s2?|m\^2|m|ms|s|Hz|kHz|deg|rad(?:/s2?)?|kg(?: m\^2)?|K|Pa|kPa|N(?: per kg)?|kt|ft|%"
_QUANTITY = re.compile(rf"{_NUMBER}(?:(?: ?(?:\+-|±) ?| to |-){_NUMBER})?(?: (?:{_UNIT})(?![\w]))?")


def sentences(text: str) -> Iterator[tuple[int, str]]:
    """The sentences of a text, each with the number of line breaks before it."""
    start = 0
    for end in [*(match.end() for match in _END.finditer(text)), len(text)]:
        piece = text[start:end]
        if piece.strip():
            yield text[: start + len(piece) - len(piece.lstrip())].count("\n"), piece
        start = end


def words(sentence: str) -> int:
    """The words of a sentence; code, and a number with its error and unit, are one each."""
    return len(_WORD.findall(_QUANTITY.sub("{}", _MARKUP.sub("{}", sentence))))


def of_python(source: str) -> Iterator[tuple[int, str]]:
    """Messages of a module, each with its line: what a value fills in counts as one word.

    A docstring is read where it is the help of a command.
    """
    tree = ast.parse(source)
    skipped: set[ast.AST] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and not _is_command(node):
                skipped.add(first.value)
        if node in skipped:
            continue
        text = _text(node)
        if text is None:
            continue
        skipped.update(ast.walk(node))
        if "\n" in text and not _is_code(text):
            at = node.lineno  # type: ignore[attr-defined]
            yield from ((at + row, line) for row, line in enumerate(text.split("\n")))
        elif not _is_code(text):
            yield node.lineno, text  # type: ignore[attr-defined]


def _is_command(node: ast.AST) -> bool:
    return isinstance(node, ast.FunctionDef) and any(
        isinstance(each, ast.Call)
        and isinstance(each.func, ast.Attribute)
        and each.func.attr in ("command", "callback")
        for each in node.decorator_list
    )


def _is_code(text: str) -> bool:
    """Whether a text is SQL or a pattern."""
    return "(?" in text or (
        re.match(r"\s*(?:SELECT|CREATE|INSERT|UPDATE|DELETE|WITH|ALTER|DROP)\b", text) is not None
    )


def _text(node: ast.AST) -> str | None:
    """The text that an expression is, or None; values in it are one word."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else None
    if isinstance(node, ast.JoinedStr):
        parts = (_text(each) if isinstance(each, ast.Constant) else "{}" for each in node.values)
        return "".join(part or "" for part in parts)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = _text(node.left), _text(node.right)
        return None if left is None and right is None else f"{left or '{}'}{right or '{}'}"
    return None


class _Page(HTMLParser):
    """The texts of a template between its blocks."""

    INLINE = frozenset(
        (
            "a",
            "abbr",
            "b",
            "code",
            "em",
            "i",
            "kbd",
            "span",
            "strong",
            "sub",
            "sup",
            "small",
            "time",
            "q",
        )
    )

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[tuple[int, str]] = []
        self._within: list[str] = []
        self._new = True

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """A block begins a text; titles and labels are texts of their own."""
        for name, value in attrs:
            if name in ("title", "aria-label", "placeholder", "alt") and value:
                self.texts.append((self.getpos()[0], value))
                self._new = True
        if tag in ("script", "style"):
            self._within.append(tag)
        self._new = self._new or tag not in self.INLINE

    def handle_endtag(self, tag: str) -> None:
        """A block ends a text."""
        if self._within and self._within[-1] == tag:
            self._within.pop()
        self._new = self._new or tag not in self.INLINE

    def handle_data(self, data: str) -> None:
        """A piece of text, joined to what stands before it in the same block."""
        if self._within:
            return
        if self._new or not self.texts:
            self.texts.append((self.getpos()[0], data))
            self._new = False
        else:
            line, before = self.texts[-1]
            self.texts[-1] = (line, before + data)


def of_template(source: str) -> list[tuple[int, str]]:
    """Texts of a template, each with its line: what a value fills in counts as one word."""

    def blank(found: re.Match[str], by: str = "") -> str:
        return by + "\n" * found[0].count("\n")

    source = re.sub(r"\{#.*?#\}", blank, source, flags=re.DOTALL)
    source = re.sub(r"\{\{.*?\}\}", lambda m: blank(m, "{}"), source, flags=re.DOTALL)
    source = re.sub(
        r"\{%-?\s*(?:else|elif)\b.*?%\}", lambda m: blank(m, "<p>"), source, flags=re.DOTALL
    )
    source = re.sub(r"\{%.*?%\}", blank, source, flags=re.DOTALL)
    page = _Page()
    page.feed(source)
    page.close()
    return page.texts


def of_document(source: str) -> Iterator[tuple[int, str]]:
    """Paragraphs, items, headings and cells of a Markdown document, each with its line."""
    fenced, text, start = False, "", 0
    for line, row in enumerate([*source.split("\n"), ""], 1):
        stripped = row.strip()
        fence = stripped.startswith("```")
        begins = re.match(r"\s*(?:[-*+]|\d+\.)\s|#|>|\||!\[", row) is not None
        if text and (not stripped or fence or begins or fenced):
            yield start, text
            text = ""
        if fence:
            fenced = not fenced
        elif not fenced and stripped.startswith("|"):
            yield from ((line, cell) for cell in _plain(stripped).split("|"))
        elif not fenced and stripped:
            start = start if text else line
            text = f"{text}\n{_plain(row)}" if text else _plain(row)


def _plain(row: str) -> str:
    return re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", row)


def faults(path: str, texts: Iterable[tuple[int, str]]) -> Iterator[Fault]:
    """What is wrong with the texts of a file."""
    explained = path.startswith(tuple(EXPLAINED))
    for line, text in texts:
        for row, sentence in sentences(text):
            said = " ".join(sentence.split())
            if words(said) > LONGEST:
                yield Fault(path, line + row, LONG, said)
            if explained or len(said.split()) < 3:  # an id is no word
                continue
            plain = _MARKUP.sub("", said)
            for word, better in PRIVATE.items():
                if re.search(rf"\b{word}\b", plain, re.IGNORECASE):
                    yield Fault(path, line + row, f"say {better}", said)


def read(root: Path = ROOT) -> Iterator[tuple[str, Iterable[tuple[int, str]]]]:
    """Every file that people read, with its texts."""
    for folder in CODE:
        for path in sorted((root / folder).rglob("*.py")):
            yield str(path.relative_to(root)), of_python(path.read_text("utf-8"))
    for pattern in TEMPLATES:
        for path in sorted(root.glob(pattern)):
            yield str(path.relative_to(root)), of_template(path.read_text("utf-8"))
    for pattern in DOCUMENTS:
        for path in sorted(root.glob(pattern)):
            yield str(path.relative_to(root)), of_document(path.read_text("utf-8"))


def main() -> int:
    """Check everything; 1 if something is broken."""
    said = [
        str(fault)
        for path, texts in read()
        if not path.startswith(tuple(SKIPPED))
        for fault in faults(path, texts)
    ]
    print("\n".join(said))
    return int(bool(said))


if __name__ == "__main__":
    sys.exit(main())
