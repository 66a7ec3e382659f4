"""Which tests a change reaches: ``python -m tests.support.reached`` prints the files that `make
check` runs.

A module reaches what it imports, anywhere in it, and what it names in a string, as tests do that
start processes. A name that a package's face hands on comes from the module that has it, not from
all of the package. What a fixture of a `conftest.py` imports is reached by who asks for it. A file
that is no module is reached by those that name it, or else by those beside it.
"""

import ast
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.support.paths import ROOT

#: Package -> its folder below the repository.
FOLDERS = {
    "aerodb": "aerodb",
    "aerodb.flows": "flows",
    "aerodb.tasks": "tasks",
    "aerodb.storage": "storage",
    "tests": "tests",
}
_DOTTED = re.compile(r"\b(?:aerodb|tests)(?:\.\w+)+")


def modules(root: Path = ROOT) -> dict[str, Path]:
    """Dotted name -> file of every module below `root`."""
    found = {}
    for package, folder in FOLDERS.items():
        for path in sorted((root / folder).rglob("*.py")):
            parts = path.relative_to(root / folder).with_suffix("").parts
            found[".".join([package, *parts]).removesuffix(".__init__")] = path
    return found


class Graph:
    """Modules below `root` and, for each, what it reaches directly."""

    def __init__(self, root: Path = ROOT) -> None:
        self.files = modules(root)
        self.texts = {name: path.read_text("utf-8") for name, path in self.files.items()}
        self._faces = {
            name: _face(name, path)
            for name, path in self.files.items()
            if path.name == "__init__.py"
        }
        trees: dict[str, ast.AST] = {name: ast.parse(text) for name, text in self.texts.items()}
        #: Fixtures of each `conftest.py`, as modules of their own.
        self._fixtures = {}
        for name in [name for name in trees if name.endswith("conftest")]:
            module = trees[name]
            assert isinstance(module, ast.Module)
            for node in [n for n in module.body if isinstance(n, ast.FunctionDef)]:
                self._fixtures[node.name] = f"{name}.{node.name}"
                trees[f"{name}.{node.name}"] = node
                module.body.remove(node)
        self.direct = {name: set(self._reached(name, tree)) for name, tree in trees.items()}

    def _reached(self, module: str, tree: ast.AST) -> Iterator[str]:
        yield from self._with_packages(module.rpartition(".")[0])
        if module.startswith("tests") and ".support" not in module:  # pytest imports it for these
            yield from (f"{above}.conftest" for above in _above(module))
        for node in _run(tree):
            if isinstance(node, ast.Import):
                for each in node.names:
                    yield from self._with_packages(each.name)
            elif isinstance(node, ast.ImportFrom):
                for each in node.names:
                    yield from self._named(self._absolute(module, node), each.name)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                for name in _DOTTED.findall(node.value):
                    yield from self._named(*name.rsplit(".", 1))
            elif module.startswith("tests"):
                for name in _fixtures_asked(node):
                    yield self._fixtures.get(name, module)

    def _absolute(self, module: str, node: ast.ImportFrom) -> str:
        if not node.level:
            return node.module or ""
        package = [module, *_above(module)][node.level - self._is_package(module)]
        return f"{package}.{node.module}" if node.module else package

    def _is_package(self, module: str) -> bool:
        return module in self.files and self.files[module].name == "__init__.py"

    def _named(self, base: str, name: str) -> Iterator[str]:
        """What has a name of a package or module: that module, itself if it is one."""
        while name in self._faces.get(base, {}):
            yield from self._with_packages(base)
            base, name = self._faces[base][name]
        yield from self._with_packages(f"{base}.{name}")

    def _with_packages(self, name: str) -> Iterator[str]:
        """A module, where it is one, and the packages above it, which are imported first."""
        yield from (each for each in (name, *_above(name)) if each in self.files)

    def reaching(self, changed: Iterable[str]) -> list[str]:
        """The changed modules and all that reach them, the nearest first."""
        importers = defaultdict(set)
        for module, reached in self.direct.items():
            for each in reached:
                importers[each].add(module)
        found = dict.fromkeys(sorted(changed))
        ahead = list(found)
        while ahead:
            further = {each for module in ahead for each in importers[module]}
            ahead = sorted(further - found.keys())
            found |= dict.fromkeys(ahead)
        return [module for module in found if module in self.files]

    def changed(self, path: Path) -> set[str]:
        """The modules that a changed file is, or that show it."""
        if path.suffix in (".py", ".pyi"):
            return {name for name, file in self.files.items() if file == path.with_suffix(".py")}
        naming = {name for name, text in self.texts.items() if path.name in text}
        return naming or {name for name, file in self.files.items() if file.parent == path.parent}


def _run(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes but docstrings and what is there for types only."""
    ahead = [tree]
    while ahead:
        node = ahead.pop()
        yield node
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        ahead += [
            child
            for child in ast.iter_child_nodes(node)
            if not (isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant))
        ]


def _fixtures_asked(node: ast.AST) -> list[str]:
    """Names of fixtures that a test or fixture takes, or that a call asks for."""
    if isinstance(node, ast.FunctionDef):
        marks = " ".join(map(ast.unparse, node.decorator_list))
        if node.name.startswith("test_") or "fixture" in marks:
            return [each.arg for each in node.args.args]
    if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(
        ("usefixtures", "getfixturevalue")
    ):
        return [each.value for each in node.args if isinstance(each, ast.Constant)]
    return []


def _above(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[:count]) for count in range(len(parts) - 1, 0, -1)]


def _face(package: str, file: Path) -> dict[str, tuple[str, str]]:
    """Name that a face hands on -> module and name there."""
    found: dict[str, tuple[str, str]] = {}
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == 1 and node.module:
            base = f"{package}.{node.module}"
            found |= {each.asname or each.name: (base, each.name) for each in node.names}
    return found


def changed_files(root: Path = ROOT) -> list[Path]:
    """Files that differ from where the branch left ``origin/main`` (without one: from HEAD),
    committed or not."""

    def git(*words: str) -> list[str]:
        done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True)
        return done.stdout.splitlines()

    (left, *_) = git("merge-base", "origin/main", "HEAD") or ["HEAD"]
    names = git("diff", "--name-only", left) + git("ls-files", "--others", "--exclude-standard")
    return [root / name for name in dict.fromkeys(names)]


def reached(changed: Iterable[Path], root: Path = ROOT) -> list[str]:
    """Files with tests that reach one of those changed, the nearest first, and tests of examples in
    the docstrings of such modules, as pytest takes them."""
    graph = Graph(root)
    found = []
    for name in graph.reaching(each for path in changed for each in graph.changed(path)):
        if name.rpartition(".")[2].startswith("test_"):
            found.append(str(graph.files[name].relative_to(root)))
        elif name.startswith("aerodb") and ">>> " in graph.texts[name]:
            found.append(f"tests/test_doctests.py::test_examples_are_true[{name}]")
    return found


if __name__ == "__main__":
    print(*reached([Path(name).resolve() for name in sys.argv[1:]] or changed_files()), sep="\n")
