"""The site has every document of the repository and every package of the science; it is built by
`make docs`."""

import doctest
import importlib.util
import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import aerodb
from tests.support.paths import ROOT


def loaded(name: str) -> ModuleType:
    """A module of docs/site, which is no package."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / "site" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def site() -> ModuleType:
    return loaded("pages")


def listed(entries: Any) -> list[str]:
    """The pages of a navigation, flat."""
    if isinstance(entries, str):
        return [entries]
    if isinstance(entries, dict):
        entries = entries.values()
    return [page for each in entries for page in listed(each)]


def test_every_document_is_in_the_navigation(site: ModuleType, tmp_path: Path) -> None:
    site.main(tmp_path)
    there = {
        path.relative_to(tmp_path / "pages").as_posix()
        for path in (tmp_path / "pages").rglob("*")
        if path.suffix in (".md", ".ipynb")
    }
    nav = listed(site.configuration()["nav"])
    assert set(nav) == there
    assert len(nav) == len(there)


def test_the_api_has_every_package_and_every_name_of_the_library(site: ModuleType) -> None:
    science = {
        path.parent.name
        for path in (ROOT / "aerodb").glob("*/__init__.py")
        if path.parent.name not in ("examples", "flows", "storage", "tasks")
    }
    assert set(site.PACKAGES) == science
    page = site.pages()["index.md"]
    for name in aerodb.__all__:
        assert f"::: aerodb.{name}\n" in page or name == "__version__", name


def test_docstrings_become_markdown() -> None:
    module = loaded("docstrings")
    assert not doctest.testmod(module).failed
    for written in (aerodb.evaluate, aerodb.load, aerodb.Client):
        text = module.as_markdown(inspect.getdoc(written))
        assert "---" not in text
        assert "**Parameters**" in text
        assert re.search(r"^- \*\*(units|vehicle|url)\*\*: ", text, re.MULTILINE)
        assert not re.search(r"^- \*\*Raises", text, re.MULTILINE)
    assert "```python\n>>> import aerodb\n" in module.as_markdown(inspect.getdoc(aerodb.evaluate))


def test_equations_are_displayed_without_a_script(
    site: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    equations = loaded("equations")
    (hook,) = site.configuration()["hooks"]
    assert Path(hook).name == "equations.py"
    monkeypatch.setattr(equations, "_displayed", lambda latex: f"<math>{latex}</math>")
    page = equations.on_page_markdown("a\n\n```math\nx = \\frac{1}{2}\n```\n\n```text\ny\n```\n")
    assert page == "a\n\n<math>x = \\frac{1}{2}\n</math>\n\n```text\ny\n```\n"
    pages = {path.name: path.read_text("utf-8") for path in (ROOT / "docs/method").glob("*.md")}
    found = {name: equations._BLOCK.findall(text) for name, text in pages.items()}
    assert sum(map(bool, found.values())) >= 5
    for name, text in pages.items():
        assert text.count("```math") == len(found[name]), f"{name}: a block that never ends"
        for latex in found[name]:
            assert latex.count("{") == latex.count("}"), latex


def test_each_method_has_equations_a_figure_and_its_evidence_elsewhere() -> None:
    methods = {path.name: path.read_text("utf-8") for path in (ROOT / "docs/method").glob("*.md")}
    evidence = {path.name for path in (ROOT / "docs/evidence").glob("*.md")}
    assert set(methods) == evidence
    for name, text in methods.items():
        assert "```math" in text, f"{name}: no displayed equation"
        assert f"](../evidence/{name})" in text, f"{name}: no way to what was measured"
        shown = re.findall(r"!\[[^\]]+\]\(\.\./pictures/([^)]+)\)", text)
        assert shown, f"{name}: no figure"
        for picture in shown:
            assert (ROOT / "docs/pictures" / picture).is_file(), picture


def test_nothing_of_the_site_is_fetched_from_elsewhere(site: ModuleType) -> None:
    theme: Any = site.configuration()["theme"]
    assert theme["font"] is False
    assert "http" not in (ROOT / "docs" / "site" / "mkdocs.yml").read_text(encoding="utf-8")
