"""Lay out the pages of the site: ``python docs/site/pages.py FOLDER``.

The repository's documents, at their own places; one page of the API per package, with the names of
its face; and the navigation's lists of folders.
"""

import ast
import sys
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[2]
#: Documents of the site, as globs of the repository.
DOCUMENTS = (
    *("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "LICENSE", "docs/*.md"),
    *("docs/*/*.md", "docs/*/*.svg", "docs/notebooks/*.ipynb", "flows/deploy/*.md"),
)
#: Packages of the API beside the library, in the order in which a flight passes them.
PACKAGES = (
    *("logs", "conditioning", "suspicions", "consistency", "coefficients", "tables", "parts"),
    *("increments", "effects", "tracing", "loop", "estimation", "identification", "simulation"),
    *("exchange", "report", "signals", "physics", "support", "vehicle"),
)
MODULES = ("recording", "flight", "nomenclature", "units", "quantities", "errors")


def documents() -> list[Path]:
    """Return the documents, relative to the repository."""
    return sorted(path.relative_to(ROOT) for pattern in DOCUMENTS for path in ROOT.glob(pattern))


def names_of(face: Path) -> list[str]:
    """Return the public names of a face, which it imports from its own modules."""
    tree = ast.parse(face.read_text(encoding="utf-8"))
    return sorted(
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.level == 1
        for alias in node.names
    )


def api_page(title: str, package: str, names: list[str], inherited: bool = False) -> str:
    """Return the page of a package: its docstring, then each public name.

    inherited : whether classes show what they have of others.
    """
    more = "\n    options: {inherited_members: true}" if inherited else ""
    parts = [f"# {title}", f"::: {package}\n    options: {{members: false, heading_level: 2}}"]
    # Functions, then classes; constants are for those who read the code.
    shown = [name for name in names if not name.strip("_").isupper()]
    for name in sorted(shown, key=lambda name: name[0].isupper()):
        parts.append(f"::: {package}.{name}" + (more if name[0].isupper() else ""))
    return "\n\n".join(parts) + "\n"


def pages() -> dict[str, str]:
    """Return the pages of the API by their file."""
    names = names_of(ROOT / "aerodb/__init__.pyi")
    found = {"index.md": api_page("The library", "aerodb", names, inherited=True)}
    for name in PACKAGES:
        names = names_of(ROOT / f"aerodb/{name}/__init__.py")
        found[f"{name}.md"] = api_page(f"aerodb.{name}", f"aerodb.{name}", names)
    for name in MODULES:
        found[f"{name}.md"] = f"# aerodb.{name}\n\n::: aerodb.{name}\n"
    return found


def in_order(folder: str) -> list[str]:
    """Return the documents of a folder: what introduces them, then the others by name."""
    found = [path.relative_to(ROOT).as_posix() for path in (ROOT / folder).glob("*.md")]
    return sorted(found, key=lambda name: (not name.endswith("README.md"), name))


def configuration() -> dict[str, Any]:
    """Return the configuration with its lists of packages, decisions and operation."""
    text = (ROOT / "docs/site/mkdocs.yml").read_text(encoding="utf-8")
    settings: dict[str, Any] = yaml.safe_load(text)
    options = settings["plugins"][1]["mkdocstrings"]["handlers"]["python"]["options"]
    options["extensions"] = [str(ROOT / "docs/site/docstrings.py")]
    lists = {folder: in_order(folder) for folder in ("docs/decisions", "flows/deploy")}
    lists["docs/api"] = [f"docs/api/{name}" for name in pages()]
    settings["hooks"] = [str(ROOT / "docs/site/equations.py")]
    settings["nav"] = [
        {title: lists.get(str(entry), entry) for title, entry in each.items()}
        if isinstance(each, dict)
        else each
        for each in settings["nav"]
    ]
    return settings


def main(folder: Path) -> None:
    """Write everything into `folder`."""
    for document in documents():
        place = folder / "pages" / document
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes((ROOT / document).read_bytes())
    for name, text in pages().items():
        place = folder / "pages/docs/api" / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text, encoding="utf-8")
    settings = configuration() | {
        "docs_dir": str(folder / "pages"),
        "site_dir": str(ROOT / "dist/docs"),
    }
    (folder / "mkdocs.yml").write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
