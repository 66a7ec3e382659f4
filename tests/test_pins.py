"""Pins and hashes: the files agree, and production needs no tool of the tests."""

import re
from importlib.metadata import requires
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.support.paths import ROOT

_PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^\s;]+)", re.MULTILINE)
_HASH = re.compile(r"--hash=sha256:[0-9a-f]{64}")


def _pins(path: Path) -> dict[str, str]:
    return {canonicalize_name(n): v for n, v in _PIN.findall(path.read_text(encoding="utf-8"))}


def _packages(path: Path) -> list[str]:
    return re.split(r"(?m)^(?=[A-Za-z])", path.read_text(encoding="utf-8"))[1:]


PINNED = _pins(ROOT / "requirements.txt")
HASHED = ROOT / "requirements-hashed.txt"
RUNTIME = ROOT / "flows" / "deploy" / "runtime.txt"


def test_what_is_installed_has_the_pinned_version_and_hashes() -> None:
    assert _pins(HASHED) == PINNED
    tools = (
        ROOT / "flows" / "deploy" / f"{kind}.txt" for kind in ("release-tools", "docs-tools", "uv")
    )
    for path in (HASHED, RUNTIME, *tools):
        for package in _packages(path):
            assert _PIN.match(package), package[:40]
            assert _HASH.search(package), package[:40]
        assert "http" not in re.sub(_PIN, "", path.read_text(encoding="utf-8"))


def test_production_needs_pinned_packages_and_no_tool_of_the_tests() -> None:
    runtime = _pins(RUNTIME)
    others = {"async-timeout"}  # of the first Pythons 3.11
    differing = {n: v for n, v in runtime.items() if PINNED.get(n) != v and n not in others}
    assert differing == {}
    tools = {
        "mkdocs",
        "ipykernel",
        "pytest",
        "hypothesis",
        "moto",
        "playwright",
        "ruff",
        "mypy",
        "schemathesis",
        "flask",
    }
    assert not tools & runtime.keys()
    for requirement in map(Requirement, requires("aerodb") or ()):
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
            assert canonicalize_name(requirement.name) in runtime


def test_the_container_installs_by_hash() -> None:
    text = (ROOT / "flows" / "deploy" / "Containerfile").read_text(encoding="utf-8")
    assert "--require-hashes -r runtime.txt" in text
    assert "requirements.txt" not in text
