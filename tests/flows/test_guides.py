"""The guides in docs/guides/ and the studies in docs/studies/ are exact: every command runs, and the
output contains every line shown, in this order.

`...` in a line stands for anything, a line of its own for any lines. Columns are compared without
the width of their gaps.
"""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from tests.support.demo_pictures import PICTURES
from tests.support.guide_flights import blocks, prepare
from tests.support.method_pictures import DRAWN
from tests.support.paths import ROOT

DOCS = ROOT / "docs"
FOLDER = DOCS / "guides"
FAILED = Path("failed")
GUIDES = (
    "px4-without-vanes",
    "with-a-boom",
    "first-finding",
    "simulators",
    "from-csv-or-mat",
    "parts",
    "multicopter",
    "helicopter",
    "build-up",
    "without-a-tunnel",
)

#: Of measured flights, which are where $AERODB_TEST_DATA says: page -> a record that it needs; none where
#: JSBSim flies.
STUDIES = {
    "twin-otter": "twin_otter/totter_f1_017_data.mat",
    "attas-dihedral": "attas/fAttasRud1.mat",
    "attas-stall": "attas/fAttas_qst01.asc",
    "hfb-320": "hfb320/hfb320_1_10.asc",
    "refused": "ampyx_ap2/validationDataFC114_1_v2_pc.mat",
    "light-aircraft": "",
}

#: Guides that the campaign follows; the second continues the first.
_LONG = ("with-a-boom", "first-finding", "simulators")


def steps(text: str) -> Iterator[tuple[str, list[str]]]:
    """Commands of a console block, each with the lines that it shows; a command goes on behind a
    backslash."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, shown = [], part.splitlines()
        while shown and (not command or command[-1].endswith("\\")):
            command.append(shown.pop(0))
        yield " ".join(line.rstrip("\\").strip() for line in command), shown


def run(command: str, folder: Path) -> str:
    """What a command says; `aerodb` is called in this process, anything else by the shell. Behind
    ` > ` stands a file for its standard output. Fails where the command does."""
    if command.startswith("aerodb "):
        command, _, file = command.partition(" > ")
        words = [name for word in shlex.split(command)[1:] for name in _expanded(word, folder)]
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, (command, result.output, result.exception)
        if not file:
            return result.output
        (folder / file).write_text(result.stdout, encoding="utf-8")
        return result.stderr
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    done = subprocess.run(
        command, shell=True, cwd=folder, capture_output=True, text=True, timeout=600, check=False,
        env={**os.environ, "PATH": path},
    )  # fmt: skip
    assert done.returncode == 0, (command, done.stderr)
    return done.stdout


def _expanded(word: str, folder: Path) -> list[str]:
    word = os.path.expandvars(word)
    return sorted(path.name for path in folder.glob(word)) if "*" in word else [word]


def missing(shown: list[str], said: str) -> str:
    """The first line of `shown` that does not follow in `said`; empty when all do."""
    lines = [" ".join(line.split()) for line in said.splitlines()]
    place, anywhere = 0, False
    for line in shown:
        wanted = " ".join(line.split())
        if wanted == "...":
            anywhere = True
            continue
        pattern = re.compile(".*".join(map(re.escape, wanted.split("..."))))
        there = next((k for k in range(place, len(lines)) if pattern.fullmatch(lines[k])), None)
        if there is None or (there > place and not anywhere):
            return line
        place, anywhere = there + 1, False
    return (
        "" if anywhere or not any(lines[place:]) else f"(nothing; but it goes on: {lines[place]})"
    )


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Path]]:
    """Guides that were followed so far, and where; those that continue another begin in its
    folder."""
    found: dict[str, Path] = {}
    before = Path.cwd()
    kept = {
        name: os.environ.pop(name)
        for name in list(os.environ)
        if name.startswith("AERODB_WORKSPACE")
    }
    found[""] = tmp_path_factory.mktemp("guides")
    yield found
    os.chdir(before)
    os.environ.update(kept)


def follow(name: str, followed: dict[str, Path]) -> Path:
    """Runs a guide, after the one that it continues; returns its folder."""
    if name in followed:
        return followed[name]  # FAILED, where it began and did not end
    guide = (DOCS / ("studies" if name in STUDIES else "guides") / f"{name}.md").read_text("utf-8")
    assert guide.count("\n```") % 2 == 0, f"{name}: a block is not closed"
    continues = re.search(r"<!-- continues: (\S+) -->", guide)
    folder = follow(continues[1], followed) if continues else followed[""] / name
    if folder == FAILED:
        pytest.fail(f"{name} continues a guide that failed")
    followed[name] = FAILED
    folder.mkdir(exist_ok=True)
    prepare(guide, folder)
    os.chdir(folder)
    for kind, _, text in blocks(guide):
        for command, shown in steps(text) if kind == "console" else ():
            said = run(command, folder)
            lacking = missing(shown, said)
            assert not lacking, f"{name}: $ {command}\nshows no line\n{lacking}\nbut\n{said}"
    followed[name] = folder
    return folder


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.campaign] if name in _LONG else []) for name in GUIDES],
)
def test_a_guide_does_what_it_says(name: str, followed: dict[str, Path]) -> None:
    if name in ("simulators", "parts"):
        pytest.importorskip("jsbsim", reason="exports to JSBSim are checked inside it")
    follow(name, followed)


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[] if n == "refused" else [pytest.mark.campaign]) for n in STUDIES],
)
def test_a_study_does_what_it_says(
    name: str,
    followed: dict[str, Path],
    measured: Callable[[str], Path],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if STUDIES[name]:
        record = measured(STUDIES[name])
        monkeypatch.setenv("AERODB_TEST_DATA", str(record.parents[1]))
    else:
        pytest.importorskip("jsbsim", reason="it flies the aircraft of this study")
    follow(name, followed)


def test_every_guide_and_study_is_followed_and_linked() -> None:
    assert {path.stem for path in FOLDER.glob("*.md")} == set(GUIDES), "nothing but guides"
    index = (DOCS / "studies" / "README.md").read_text(encoding="utf-8")
    studies = {path.stem for path in (DOCS / "studies").glob("*.md")} - {"README"}
    assert studies == set(STUDIES) == set(re.findall(r"\]\(([\w-]+)\.md\)", index))
    listed = {path.name for path in DOCS.glob("*.md")}
    assert listed == {"README.md", "security.md"}, "the list of documents"
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    linked = set(re.findall(r"\]\((docs/[^)#]+)\)", readme))
    assert {"docs/README.md", *(f"docs/guides/{name}.md" for name in GUIDES)} <= linked
    assert not [link for link in linked if not (DOCS.parent / link).exists()]


def test_links_between_documents_lead_to_files() -> None:
    pages = [*DOCS.rglob("*.md"), *(ROOT / "flows" / "deploy").glob("*.md")]
    pages += [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    links = [
        (page.relative_to(ROOT), link)
        for page in pages
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text("utf-8"))
        if "://" not in link
    ]
    assert len(links) > 20
    assert not [(page, link) for page, link in links if not (ROOT / page.parent / link).exists()]


def test_a_guide_that_shows_what_is_not_said_fails() -> None:
    said = "axis  before\nCZ      0.5\nCm      0.1\n"
    assert missing(["axis before", "CZ 0...", "..."], said) == ""
    assert missing(["...", "Cm 0.1"], said) == ""
    assert missing(["CZ 0.5", "..."], said) == "CZ 0.5", "a line was left out without saying so"
    assert missing(["...", "CZ 0.6"], said) == "CZ 0.6"
    assert missing(["...", "Cm 0.1", "...", "CZ 0.5"], said) == "CZ 0.5", "the order counts"
    assert "Cm 0.1" in missing(["axis before", "CZ 0.5"], said), "it says more than shown"
    assert list(steps("$ a \\\n  b\nx\n$ c\n")) == [("a b", ["x"]), ("c", [])]


def test_pictures_are_small_used_and_all_there() -> None:
    pages = [DOCS.parent / "README.md", *(DOCS / "method").glob("*.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    used = set(re.findall(r"!\[[^\]]+\]\((?:docs|\.\.)/pictures/([^)]+)\)", text))
    there = {path.name: path for path in (DOCS / "pictures").iterdir()}
    assert used == set(there)
    assert used == {*PICTURES, *DRAWN}, "make pictures renews them all"
    assert all(path.stat().st_size < 150_000 for path in there.values())
    assert not [
        name
        for name, path in there.items()
        if re.search(r"<script|https?://(?!www\.w3\.org/)", path.read_text("utf-8"))
    ]
