"""Numeric constants of modules, found in the source, changed while it is imported, and counted
where they are read.

Nothing here imports the product, so that a process can change a constant before it does.
"""

import ast
import builtins
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

#: Name under which an instrumented module reports what it reads.
_READ = "__constant_read__"


@dataclass(frozen=True)
class NumericConstant:
    """A numeric constant of a module.

    module : dotted. name : of the constant. source : its value as written. unit : in brackets in
    its comment; empty for a dimensionless one. comment : the `#:` lines above it, joined.
    """

    module: str
    name: str
    source: str
    unit: str
    comment: str

    @property
    def id(self) -> str:
        """Module and name, below `aerodb`."""
        return f"{self.module.removeprefix('aerodb.')}.{self.name}"


def numeric_constants(root: Path, modules: Sequence[str]) -> tuple[NumericConstant, ...]:
    """The numeric constants of modules, dotted, below the folder `root`, in their order."""
    listed = []
    for module in modules:
        text = (root / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8")
        lines = text.splitlines()
        for name, value, line in _assigned(ast.parse(text)):
            above = line - 2
            comment: list[str] = []
            while above >= 0 and lines[above].startswith("#: "):
                comment.insert(0, lines[above].removeprefix("#: "))
                above -= 1
            words = " ".join(comment)
            unit = re.search(r"\[([^\]]+)\]", words)
            source = ast.unparse(value)
            listed.append(
                NumericConstant(module, name, source, unit[1] if unit else "", words)
            )  # fmt: skip
    return tuple(listed)


def _assigned(tree: ast.Module) -> Iterator[tuple[str, ast.expr, int]]:
    """Name, value and line of each constant that is a number, or a tuple or mapping with some."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name, value = node.targets[0].id, node.value
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value:
            name, value = node.target.id, node.value
        else:
            continue
        if name.isupper() and _is_numeric(value):
            yield name, value, node.lineno


def _is_numeric(node: ast.expr) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.BinOp):
        return _is_numeric(node.left) or _is_numeric(node.right)
    if isinstance(node, ast.UnaryOp):
        return _is_numeric(node.operand)
    if isinstance(node, ast.Tuple | ast.List):
        return any(map(_is_numeric, node.elts))
    if isinstance(node, ast.Dict):
        return any(map(_is_numeric, node.values))
    if isinstance(node, ast.Call):
        called = ast.unparse(node.func)
        return called in ("np.deg2rad", "math.radians", "dict.fromkeys") and any(
            map(_is_numeric, node.args)
        )
    return False


def scaled(node: ast.expr, factor: float) -> ast.expr:
    """An expression with its numbers times `factor`; whole numbers change by one at least.

    Tuples, mappings and their like are scaled as a whole.
    """
    if isinstance(node, ast.Tuple):
        return ast.Tuple([scaled(each, factor) for each in node.elts], ast.Load())
    if isinstance(node, ast.Dict):
        return ast.Dict(node.keys, [scaled(each, factor) for each in node.values])
    if isinstance(node, ast.Call):
        return ast.Call(node.func, [scaled(each, factor) for each in node.args], node.keywords)
    if isinstance(node, ast.Constant) and isinstance(node.value, int):
        rounded = math.floor if factor < 1.0 else math.ceil
        away = -1 if factor < 1.0 else 1
        changed = rounded(node.value * factor)
        return ast.Constant(changed if changed != node.value else node.value + away)
    if _is_numeric(node):
        return ast.BinOp(node, ast.Mult(), ast.Constant(factor))
    return node


class _Loader(SourceFileLoader):
    """Loads one module whose source tree is changed; keeps no byte code."""

    def __init__(self, name: str, path: str, change: ast.NodeTransformer) -> None:
        super().__init__(name, path)
        self.change = change

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        tree = self.change.visit(ast.parse(self.get_data(path)))
        return compile(ast.fix_missing_locations(tree), path, "exec")


class _Finder(MetaPathFinder):
    """Finds some modules with a change to each."""

    def __init__(self, changes: Mapping[str, ast.NodeTransformer]) -> None:
        self.changes = changes

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name not in self.changes:
            return None
        spec = PathFinder.find_spec(name, path)
        if spec is not None and spec.origin is not None:
            spec.loader = _Loader(name, spec.origin, self.changes[name])
        return spec


class _Scaling(ast.NodeTransformer):
    def __init__(self, name: str, factor: float) -> None:
        self.name, self.factor, self.found = name, factor, False

    def visit_Module(self, node: ast.Module) -> ast.Module:
        for each in node.body:
            targets = each.targets if isinstance(each, ast.Assign) else []
            targets = [each.target] if isinstance(each, ast.AnnAssign) else targets
            if any(isinstance(t, ast.Name) and t.id == self.name for t in targets):
                each.value = scaled(each.value, self.factor)  # type: ignore[union-attr]
        return node


class _Reporting(ast.NodeTransformer):
    """Every read of a constant inside a function reports it."""

    def __init__(self, ids: Mapping[str, str]) -> None:
        self.ids, self.inside = ids, 0

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        self.inside += 1
        node.body = [self.visit(each) for each in node.body]
        self.inside -= 1
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if self.inside and isinstance(node.ctx, ast.Load) and node.id in self.ids:
            read = ast.Name(_READ, ast.Load())
            return ast.Call(read, [ast.Constant(self.ids[node.id]), node], [])
        return node


def change_on_import(constant: NumericConstant, factor: float) -> None:
    """Scale a constant when its module is imported, which must not have happened."""
    if constant.module in sys.modules:
        raise RuntimeError(f"{constant.module} is imported already")
    sys.meta_path.insert(0, _Finder({constant.module: _Scaling(constant.name, factor)}))


def report_on_import(root: Path, constants: Sequence[NumericConstant]) -> set[str]:
    """Collect the ids of constants that functions read, from modules imported from now on.

    The set is filled while they run; clear it between runs.
    """
    changes: dict[str, ast.NodeTransformer] = {}
    for module, text in _modules(root).items():
        ids = {
            name: each.id
            for each in constants
            if each.name in text
            for name in _names_in(each, module, ast.parse(text))
        }
        if ids and "numba" not in text:
            changes[module] = _Reporting(ids)
    seen: set[str] = set()

    def read(name: str, value: object) -> object:
        seen.add(name)
        return value

    setattr(builtins, _READ, read)
    sys.meta_path.insert(0, _Finder(changes))
    return seen


def read_at_import(root: Path, constant: NumericConstant) -> bool:
    """Whether a constant is read outside of functions: by another constant, a default, a field."""
    for module, text in _modules(root).items():
        if constant.name not in text:
            continue
        tree = ast.parse(text)
        names = _names_in(constant, module, tree)
        inside = set()
        for node in ast.walk(tree) if names else ():
            if isinstance(node, ast.FunctionDef):
                for each in node.body:
                    inside |= {id(n) for n in ast.walk(each)}
        if names and any(
            isinstance(node, ast.Name)
            and isinstance(node.ctx, ast.Load)
            and node.id in names
            and id(node) not in inside
            for node in ast.walk(tree)
        ):
            return True
    return False


@cache
def _modules(root: Path) -> dict[str, str]:
    """Dotted name -> text of every module of the product."""
    return {
        ".".join(path.relative_to(root).with_suffix("").parts): path.read_text(encoding="utf-8")
        for path in sorted((root / "aerodb").rglob("*.py"))
        if path.stem != "__init__"
    }


def _names_in(constant: NumericConstant, module: str, tree: ast.Module) -> set[str]:
    """The names that a constant has in a module: its own, or as it is imported from its module or
    from the face of a package above it."""
    names = {constant.name} if module == constant.module else set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and f"{constant.module}.".startswith(f"{node.module}."):
            names |= {a.asname or a.name for a in node.names if a.name == constant.name}
    return names
