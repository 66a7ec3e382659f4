"""What `make check` runs: the tests that a change reaches, on a small repository."""

from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.reached import Graph, changed_files, reached

FILES = {
    "aerodb/__init__.py": "",
    "aerodb/tables/__init__.py": '"""See aerodb.tables.scattered."""\nif TYPE_CHECKING:\n'
    "    from .database import Database as Database\n    from .nodes import vary",
    "aerodb/tables/database.py": "from .nodes import vary",
    "aerodb/tables/nodes.py": "'''>>> 1\n1\n'''\nimport typing",
    "aerodb/tables/scattered.py": "",
    "flows/__init__.py": "",
    "flows/main.py": "def main():\n    from aerodb.tables import Database",
    "flows/page.html": "",
    "tests/__init__.py": "",
    "tests/conftest.py": "import pytest\n@pytest.fixture\ndef built():\n    import tests.helper",
    "tests/helper.py": "from aerodb.tables import scattered",
    "tests/test_face.py": "from aerodb.tables import Database",
    "tests/test_name.py": "from aerodb.tables import vary",
    "tests/test_run.py": "run('from aerodb.flows.main import main; main()')",
    "tests/test_asks.py": "def test_this(built): pass",
    "tests/test_types.py": "if TYPE_CHECKING:\n    from aerodb.tables import Database",
    "tests/test_page.py": "PAGE = 'page.html'",
}
NODES = "doctests.py::test_examples_are_true[aerodb.tables.nodes]"


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("changed", "tests"),
    [
        ("aerodb/tables/database.py", {"face", "run"}),
        ("aerodb/tables/nodes.py", {"face", "run", "name", NODES}),
        ("aerodb/tables/scattered.py", {"asks"}),
        ("flows/main.py", {"run"}),
        ("flows/page.html", {"page"}),
        ("tests/helper.py", {"asks"}),
        ("tests/test_face.py", {"face"}),
        ("tests/conftest.py", {"face", "name", "run", "asks", "types", "page"}),
        ("aerodb/tables/__init__.py", {"face", "name", "run", "asks", NODES}),
        ("README.md", set()),
    ],
)
def test_a_change_reaches_what_imports_names_or_asks_for_it(
    repository: Path, changed: str, tests: set[str]
) -> None:
    found = reached([repository / changed], repository)
    assert {each.removeprefix("tests/test_").removesuffix(".py") for each in found} == tests


def test_the_nearest_come_first(repository: Path) -> None:
    found = reached([repository / "aerodb/tables/nodes.py"], repository)
    assert found.index("tests/test_name.py") < found.index("tests/test_run.py")


@pytest.mark.campaign
def test_here_a_command_reaches_what_it_runs_and_science_does_not_reach_flows() -> None:
    graph = Graph()
    flows = graph.reaching(["aerodb.flows.close_loop"])
    assert {"tests.flows.test_cli", "tests.flows.test_demo"} <= set(flows)
    assert not [name for name in flows if name.startswith("tests.aerodb.estimation")]
    assert {path.is_relative_to(ROOT) for path in changed_files()} <= {True}
