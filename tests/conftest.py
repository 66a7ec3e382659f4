"""Where tests find measured flight data, and what they share."""

import gc
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, settings

from tests.support import postgresql
from tests.support.order import ByFiles, long_first

if TYPE_CHECKING:
    from tests.support.object_service import ObjectService
    from tests.support.shared_workspace import SharedWorkspaces

_BEGUN = pytest.StashKey[float]()

#: New objects between two searches for garbage, as in a command (`aerodb.flows.cli.main`).
_OBJECTS = 50_000


@pytest.fixture(scope="session")
def measured() -> Callable[[str], Path]:
    """Path of a measured data file below $AERODB_TEST_DATA (default ../shared/data beside the
    project); skips when absent."""
    default = Path(__file__).resolve().parents[1].parent / "shared" / "data"
    root = Path(os.environ.get("AERODB_TEST_DATA", default))

    def find(relative: str) -> Path:
        path = root / relative
        if not path.exists():
            pytest.skip(f"measured data not here: {relative} (set AERODB_TEST_DATA)")
        return path

    return find


def pytest_addoption(parser: pytest.Parser) -> None:
    """`make campaign` runs the heavy tests with their full numbers of trials, and those marked
    campaign."""
    parser.addoption(
        "--full-campaign", action="store_true", help="full numbers of trials in tests marked heavy"
    )
    parser.addoption(
        "--within", type=float, help="begin no test later than this [s]; files as they are given"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Drawn examples are the same in every run of the suite, and others in every campaign; how long
    one takes is no fault."""
    gc.set_threshold(_OBJECTS)
    same = (
        {"derandomize": True, "database": None}
        if not config.getoption("--full-campaign")
        else {"print_blob": True}
    )
    settings.register_profile(
        "aerodb", deadline=None, suppress_health_check=[HealthCheck.too_slow], **same
    )
    settings.load_profile("aerodb")


@pytest.hookimpl(tryfirst=True)  # before `-m` chooses
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Long files first; what only the campaign runs is skipped without it."""
    if config.getoption("--within") is None:
        long_first(items)
    first: dict[object, object] = {}
    for item in items:
        if _repeats(item, first):
            item.add_marker(pytest.mark.campaign)
        if item.get_closest_marker("campaign") and not config.getoption("--full-campaign"):
            item.add_marker(pytest.mark.skip(reason="runs in `make campaign`"))


def pytest_collection_finish() -> None:
    """What was imported and collected is no garbage: looked through again and again, it takes a
    tenth of the time of tests that make many objects."""
    gc.collect()
    gc.freeze()


#: Files in which PostgreSQL's transactions, locks and types are the subject.
_BOTH = (
    "test_catalogue_safety.py",
    "test_former_catalogues.py",
    "test_row_links.py",
    "test_tampering.py",
)


def _repeats(item: pytest.Item, first: dict[object, object]) -> bool:
    """Whether a test is the same as another with a further seed, or in the other database; `first`
    has the seeds that were met first."""
    given = (
        dict(item.callspec.params)
        if isinstance(item, pytest.Function) and hasattr(item, "callspec")
        else {}
    )
    if given.get("kept_in") == "postgresql" and item.path.name not in _BOTH:
        return True
    if "seed" not in given:
        return False
    seed = given.pop("seed")
    return first.setdefault((item.path, item.originalname, str(given)), seed) != seed


def pytest_sessionstart(session: pytest.Session) -> None:
    session.config.stash[_BEGUN] = time.monotonic()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """`make check` ends in time; `make test` runs all."""
    within = item.config.getoption("--within")
    if within is not None and time.monotonic() > item.config.stash[_BEGUN] + within:
        pytest.skip("not in the time of `make check`; runs in `make test`")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByFiles | None:
    """By files (``--dist loadfile``), in that order."""
    return ByFiles(config, log) if config.getoption("dist") == "loadfile" else None


@pytest.fixture(scope="session")
def trials(request: pytest.FixtureRequest) -> Callable[[int, int], int]:
    """How many seeded trials a heavy test does: `reduced` in the suite, `full` under
    --full-campaign."""
    full_campaign = request.config.getoption("--full-campaign")
    return lambda reduced, full: full if full_campaign else reduced


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> "SharedWorkspaces":
    """Workspaces of the small glider, built once per session, to be copied."""
    from tests.support.shared_workspace import (
        SharedWorkspaces,
    )  # imports the flows, for which other tests need not wait

    return SharedWorkspaces(tmp_path_factory)


@pytest.fixture(scope="session")
def logs(shared: "SharedWorkspaces") -> list[Path]:
    """The small glider's six logs, which stand beside its files and which nobody changes."""
    return shared.logs


@pytest.fixture(scope="session")
def postgresql_server() -> Iterator[postgresql.Server]:
    """A PostgreSQL server of this machine; skips where there is none."""
    if postgresql.binaries() is None:
        pytest.skip(
            "no PostgreSQL server on this machine (initdb and postgres in PATH or"
            " /usr/lib/postgresql)"
        )
    server = postgresql.Server()
    yield server
    server.remove()


@pytest.fixture(scope="module")
def service() -> Iterator["ObjectService"]:
    """A real S3 service for the tests of one file."""
    from tests.support.object_service import (
        object_service,
    )  # half a second that other tests need not wait for

    with object_service() as running:
        yield running


@pytest.fixture(params=["sqlite", "postgresql"])
def kept_in(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """What holds the catalogue of the folder `tmp_path`: its file, or a database that the settings
    there name."""
    if request.param == "sqlite":
        yield "sqlite"
        return
    server = request.getfixturevalue("postgresql_server")
    database = server.catalogue()
    postgresql.name_in_settings(tmp_path, server.url(database))
    yield "postgresql"
    server.drop(database)


@pytest.fixture
def database(postgresql_server: postgresql.Server) -> Iterator[str]:
    """The name of a database with an empty catalogue."""
    name = postgresql_server.catalogue()
    yield name
    postgresql_server.drop(name)
